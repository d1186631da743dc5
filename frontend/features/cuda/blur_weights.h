#pragma once

#include <string>
#include <vector>

#include "frontend/features/sift.h"

namespace hybrid_slam::cuda {

// Kernels of odd size, symmetric, of which one application is all that the definition applies one
// after the other.

// From an image, with zeros in between if it is upsampled, to the first level of its first octave.
std::vector<double> first_level_weights(double initial_sigma, bool upsample);

// From the first level of an octave to each level from the second: layers + 2 kernels.
std::vector<std::vector<double>> level_weights(double initial_sigma, int layers);

// Those of all levels, then that of the first level.
std::vector<std::vector<double>> all_weights(const SiftOptions& options);

int reach_of(const std::vector<double>& kernel);

// Empty if no kernel of all_weights() reaches farther than kMaxReach (scale_space_kernels.h).
std::string why_blurs_too_large(const SiftOptions& options);

// Kernels in the form of scale_space_kernels.h: kMaxTaps weights each, none of which may reach
// farther than kMaxReach.
std::vector<float> padded_weights(const std::vector<std::vector<double>>& kernels);

}  // namespace hybrid_slam::cuda
