#pragma once

#include <cstdint>
#include <cstring>

#include "frontend/features/cuda/parallel.h"

namespace hybrid_slam::cuda {

// A place in the scale space that SIFT describes.
struct Extremum {
  float x, y;                           // in the image [px]
  float scale;                          // [px]
  float response;                       // |difference of Gaussians| [grey levels]
  float level_x, level_y, level_scale;  // in its level [samples]
  std::int16_t octave;                  // counted from the first that there is
  std::int16_t level;                   // the one that is nearest in blur
};

// The order of strength of frontend/features/feature_selection.h. The octave makes it total.
HS_HOST_DEVICE inline bool stronger(const Extremum& a, const Extremum& b) {
  if (a.response != b.response) return a.response > b.response;
  if (a.y != b.y) return a.y < b.y;
  if (a.x != b.x) return a.x < b.x;
  if (a.scale != b.scale) return a.scale < b.scale;
  return a.octave < b.octave;
}

// Extrema are sorted into buckets by response, the strongest first: 256 for each doubling from
// 2^-8 to 2^8.
constexpr int kBuckets = 16 * 256;

HS_HOST_DEVICE inline int bucket_of(float response) {
  std::int32_t bits;
  memcpy(&bits, &response, sizeof bits);
  const int step = (bits >> 15) - ((127 - 8) << 8);
  return kBuckets - 1 - (step < 0 ? 0 : step < kBuckets ? step : kBuckets - 1);
}

}  // namespace hybrid_slam::cuda
