#include "frontend/matching/image_pyramid.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "frontend/features/cpu/first_level.h"
#include "frontend/features/cpu/row_kernels.h"
#include "frontend/features/cpu/row_store.h"
#include "frontend/features/definition/patch.h"
#include "frontend/features/definition/scale_space.h"

namespace hybrid_slam {
namespace {

static_assert(ImagePyramid::kUnits == sift::kLevelUnits);

constexpr int kMinLevelSize = 16;

using Level = ImagePyramid::Level;

Level empty_level(int width, int height) {
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  return {width, height, std::vector<std::uint16_t>(pixels)};
}

std::uint16_t* row_of(Level& level, int y) {
  return level.pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(level.width);
}

// Blurs an image row by row, along the columns and then along the row, mirrored at its sides.
class Blur {
 public:
  Blur(double sigma, int width, int height)
      : kernel_(sigma, sift::KernelCentre::kSample),
        width_(static_cast<std::size_t>(width)),
        height_(height),
        rows_(width, kernel_.size()),
        along_columns_(width, kernel_.reach()),
        blurred_(width, 0),
        pointers_(kernel_.weights.size()) {}

  // For rows in ascending order, until the next call. `read(row, to)` gives the image's, each once.
  template <typename Read>
  const float* row(int y, const Read& read) {
    const int first = y - kernel_.reach();
    const int end = std::min(first + kernel_.size(), height_);
    for (; read_ < end; ++read_) read(read_, rows_.row(read_));
    for (std::size_t i = 0; i < pointers_.size(); ++i) {
      pointers_[i] = rows_.row(sift::mirrored(first + static_cast<int>(i), height_));
    }
    sum(along_columns_.samples());
    along_columns_.mirror();
    for (std::size_t i = 0; i < pointers_.size(); ++i) {
      pointers_[i] = along_columns_.samples() - kernel_.reach() + i;
    }
    sum(blurred_.samples());
    return blurred_.samples();
  }

 private:
  void sum(float* out) {
    sift::symmetric_sum(pointers_.data(), pointers_.size(), kernel_.weights.data(), width_, out);
  }

  sift::Kernel kernel_;
  std::size_t width_;
  int height_;
  int read_ = 0;
  sift::RowStore rows_;  // of the image
  sift::PaddedRow along_columns_, blurred_;
  std::vector<const float*> pointers_;
};

Level smooth(const GrayImage& image, double sigma) {
  Level level = empty_level(image.width, image.height);
  Blur blur(sigma, image.width, image.height);
  const auto width = static_cast<std::size_t>(image.width);
  const auto read = [&](int row, float* to) { sift::to_floats(image.row(row), width, to); };
  for (int y = 0; y < image.height; ++y) {
    sift::to_fixed_point(blur.row(y, read), width, row_of(level, y));
  }
  return level;
}

// Every other pixel, blurred so far that the half-size image has the blur it had before.
Level halve(const Level& whole, double sigma) {
  Level half = empty_level((whole.width + 1) / 2, (whole.height + 1) / 2);
  Blur blur(std::sqrt(3.0) * sigma, whole.width, whole.height);
  sift::PaddedRow every_other(half.width, 0);
  const auto width = static_cast<std::size_t>(whole.width);
  const auto read = [&](int row, float* to) { sift::from_fixed_point(whole.row(row), width, to); };
  for (int y = 0; y < half.height; ++y) {
    const float* blurred = blur.row(2 * y, read);
    for (int x = 0; x < half.width; ++x) every_other.samples()[x] = blurred[2 * x];
    sift::to_fixed_point(every_other.samples(), static_cast<std::size_t>(half.width),
                         row_of(half, y));
  }
  return half;
}

}  // namespace

ImagePyramid::ImagePyramid(const GrayImage& image, int levels, double blur) {
  if (image.empty()) throw std::logic_error("ImagePyramid: empty image");
  levels_.push_back(smooth(image, blur));
  while (this->levels() < levels) {
    const Level& last = levels_.back();
    if ((std::min(last.width, last.height) + 1) / 2 < kMinLevelSize) break;
    levels_.push_back(halve(last, blur));
  }
}

}  // namespace hybrid_slam
