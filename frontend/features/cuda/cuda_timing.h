#pragma once

#include <string>
#include <utility>
#include <vector>

namespace hybrid_slam {

// What is timed by events of the device, for measurements.
enum class CudaTiming {
  kOff,
  kWhole,  // upload, kernels, download, which run as they do otherwise
  kStages  // every stage; kernels are launched one by one, which takes longer as a whole
};

// Names and milliseconds, in the order in which they ran.
using CudaStageTimes = std::vector<std::pair<std::string, double>>;

}  // namespace hybrid_slam
