#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "backend/map/features.h"
#include "frontend/features/definition/parameters.h"

namespace hybrid_slam {

// Squared Euclidean distance of the bytes, exact: 0 .. 128 * 255^2.
std::int32_t squared_distance(const Descriptor& a, const Descriptor& b);

// distances[k] = squared_distance(query, descriptors[candidates[k]]). Many at once are cheaper.
// `candidates` and `distances` have the same size.
void squared_distances(const Descriptor& query, std::span<const Descriptor> descriptors,
                       std::span<const int> candidates, std::span<std::int32_t> distances);

// A distance between unit descriptors (the thresholds in options) as a squared distance of bytes,
// rounded down; and back. Descriptors have a length of 512.
constexpr double kDescriptorLength = 512;
inline std::int32_t to_squared_bytes(double distance) {
  const double bytes = std::max(0.0, distance) * kDescriptorLength;
  constexpr double kMax = std::numeric_limits<std::int32_t>::max();
  return static_cast<std::int32_t>(std::min(std::floor(bytes * bytes), kMax));
}
inline double from_squared_bytes(std::int32_t squared_distance) {
  return std::sqrt(static_cast<double>(squared_distance)) / kDescriptorLength;
}

// Whether `best` beats `second` clearly: best < ratio * second, as distances (not squared). True if
// there is no second (negative).
HS_HOST_DEVICE inline bool passes_ratio(std::int32_t best, std::int32_t second, double ratio) {
  return second < 0 || best < ratio * ratio * second;
}

}  // namespace hybrid_slam
