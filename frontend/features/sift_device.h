#pragma once

#include <memory>
#include <string>

#include "frontend/features/sift.h"

namespace hybrid_slam {

// What SIFT runs on. The features are the same up to rounding.
enum class SiftDevice { kCpu, kCuda };

std::string to_string(SiftDevice device);

// Empty if this build can use a CUDA device, there is one, and the engine for it takes these
// options; else why not, in one line.
std::string why_no_cuda_sift(const SiftOptions& options);

// Throws std::invalid_argument if the options are not valid for the engine, std::runtime_error if
// there is no such device.
std::unique_ptr<SiftExtractor> make_sift_on(SiftDevice device, const SiftOptions& options);

}  // namespace hybrid_slam
