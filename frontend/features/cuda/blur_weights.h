#pragma once

#include <vector>

namespace hybrid_slam::cuda {

// Kernels of odd size, symmetric, of which one application is all that the definition applies one
// after the other.

// From an image, with zeros in between if it is upsampled, to the first level of its first octave.
std::vector<double> first_level_weights(double initial_sigma, bool upsample);

// From the first level of an octave to each level from the second: layers + 2 kernels.
std::vector<std::vector<double>> level_weights(double initial_sigma, int layers);

// Kernels in the form of scale_space_kernels.h: kMaxTaps weights each. Throws
// std::invalid_argument if one reaches farther than kMaxReach.
std::vector<float> padded_weights(const std::vector<std::vector<double>>& kernels);

int reach_of(const std::vector<double>& kernel);

}  // namespace hybrid_slam::cuda
