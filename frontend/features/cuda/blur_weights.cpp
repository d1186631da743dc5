#include "frontend/features/cuda/blur_weights.h"

#include <algorithm>
#include <stdexcept>

#include "frontend/features/cuda/scale_space_kernels.h"
#include "frontend/features/definition/scale_space.h"

namespace hybrid_slam::cuda {
namespace {

std::vector<double> weights_of(double sigma, sift::KernelCentre centre) {
  std::vector<float> weights(static_cast<std::size_t>(sift::kernel_size(sigma, centre)));
  sift::make_kernel(sigma, centre, weights.data());
  return {weights.begin(), weights.end()};
}

std::vector<double> convolved(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> out(a.size() + b.size() - 1);
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < b.size(); ++k) out[i + k] += a[i] * b[k];
  }
  return out;
}

}  // namespace

int reach_of(const std::vector<double>& kernel) { return static_cast<int>(kernel.size() / 2); }

// At a sample that stands at a pixel, pixels are an even number of samples away, between two an odd
// number: one kernel holds the weights for both.
std::vector<double> first_level_weights(double initial_sigma, bool upsample) {
  const double sigma = sift::first_level_sigma(initial_sigma, upsample);
  const std::vector<double> at_pixel = weights_of(sigma, sift::KernelCentre::kSample);
  if (!upsample) return at_pixel;
  const std::vector<double> between = weights_of(sigma, sift::KernelCentre::kBetweenSamples);
  const std::size_t reach = std::max(at_pixel.size(), between.size()) - 1;
  std::vector<double> both(2 * reach + 1);
  for (const auto* part : {&at_pixel, &between}) {
    const std::size_t first = reach - (part->size() - 1);
    for (std::size_t i = 0; i < part->size(); ++i) both[first + 2 * i] = (*part)[i];
  }
  return both;
}

std::vector<std::vector<double>> level_weights(double initial_sigma, int layers) {
  std::vector<std::vector<double>> kernels;
  std::vector<double> all{1.0};
  for (int level = 1; level < layers + 3; ++level) {
    const double step = sift::level_step_sigma(initial_sigma, layers, level);
    all = convolved(all, weights_of(step, sift::KernelCentre::kSample));
    kernels.push_back(all);
  }
  return kernels;
}

std::vector<std::vector<double>> all_weights(const SiftOptions& options) {
  std::vector<std::vector<double>> kernels =
      level_weights(options.initial_sigma, options.octave_layers);
  kernels.push_back(first_level_weights(options.initial_sigma, options.upsample));
  return kernels;
}

std::string why_blurs_too_large(const SiftOptions& options) {
  const std::string too_large = "initial_sigma is too large for CUDA's SIFT";
  double reach = 0;  // before kernels are made: they would be of any size
  for (int level = 1; level < options.octave_layers + 3; ++level) {
    reach += sift::kKernelSigmas *
             sift::level_step_sigma(options.initial_sigma, options.octave_layers, level);
  }
  if (!(reach <= kMaxReach)) return too_large;
  const std::vector<std::vector<double>> kernels = all_weights(options);
  const bool fit = std::all_of(kernels.begin(), kernels.end(),
                               [](const auto& kernel) { return reach_of(kernel) <= kMaxReach; });
  return fit ? std::string() : too_large;
}

std::vector<float> padded_weights(const std::vector<std::vector<double>>& kernels) {
  std::vector<float> weights(kernels.size() * kMaxTaps);
  for (std::size_t k = 0; k < kernels.size(); ++k) {
    if (reach_of(kernels[k]) > kMaxReach) throw std::logic_error("a kernel reaches too far");
    std::transform(kernels[k].begin(), kernels[k].end(),
                   weights.begin() + static_cast<std::ptrdiff_t>(k * kMaxTaps),
                   [](double weight) { return static_cast<float>(weight); });
  }
  return weights;
}

}  // namespace hybrid_slam::cuda
