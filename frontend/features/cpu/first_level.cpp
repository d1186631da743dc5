#include "frontend/features/cpu/first_level.h"

#include <algorithm>

#include "frontend/features/definition/scale_space.h"

namespace hybrid_slam::sift {

Kernel::Kernel(double sigma, KernelCentre centre)
    : weights(static_cast<std::size_t>(kernel_size(sigma, centre))) {
  make_kernel(sigma, centre, weights.data());
}

FirstLevel::FirstLevel(double initial_sigma, bool upsample, int width, int height)
    : upsample_(upsample),
      width_(width),
      height_(height),
      at_sample_(first_level_sigma(initial_sigma, upsample), KernelCentre::kSample),
      between_(first_level_sigma(initial_sigma, upsample), KernelCentre::kBetweenSamples),
      rows_(upsample ? 2 * width : width, between_.size()),
      input_(width, between_.size()),
      even_(width, 0),
      odd_(width, 0),
      pointers_(static_cast<std::size_t>(between_.size())) {}

void FirstLevel::sum_shifted(const Kernel& kernel, float* out) {
  const float* first = input_.samples() - kernel.reach();
  for (std::size_t i = 0; i < kernel.weights.size(); ++i) pointers_[i] = first + i;
  symmetric_sum(pointers_.data(), kernel.weights.size(), kernel.weights.data(),
                static_cast<std::size_t>(width_), out);
}

void FirstLevel::read_row(const GrayImage& image, int row) {
  to_floats(image.row(row), static_cast<std::size_t>(width_), input_.samples());
  input_.mirror();
  if (!upsample_) {
    sum_shifted(at_sample_, rows_.row(row));
    return;
  }
  sum_shifted(at_sample_, even_.samples());
  sum_shifted(between_, odd_.samples());
  interleave(even_.samples(), odd_.samples(), static_cast<std::size_t>(width_), rows_.row(row));
}

void FirstLevel::make_row(const GrayImage& image, int y, float* out) {
  if (y == 0) rows_read_ = 0;
  const Kernel& kernel = upsample_ && y % 2 == 1 ? between_ : at_sample_;
  const int first = (upsample_ ? y / 2 : y) - kernel.reach();
  const int end = std::min(first + kernel.size(), height_);
  for (; rows_read_ < end; ++rows_read_) read_row(image, rows_read_);
  for (int i = 0; i < kernel.size(); ++i) {
    pointers_[static_cast<std::size_t>(i)] = rows_.row(mirrored(first + i, height_));
  }
  symmetric_sum(pointers_.data(), kernel.weights.size(), kernel.weights.data(),
                static_cast<std::size_t>(upsample_ ? 2 * width_ - 1 : width_), out);
}

}  // namespace hybrid_slam::sift
