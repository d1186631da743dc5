#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "backend/map/features.h"
#include "backend/map/ids.h"

namespace hybrid_slam {

inline constexpr float kNoRightMatch = std::numeric_limits<float>::quiet_NaN();

// Everything measured in one frame by one camera (a rectified stereo pair is one camera, whose
// keypoints are those of the left image). Never changes once it is part of a keyframe; shared. A
// keyframe whose features are dropped gets others, with fewer keypoints.
struct FrameObservations {
  CameraId camera;
  std::int64_t frame_index = 0;
  double time = 0;  // [s]
  FeatureSet features;
  std::vector<float>
      u_right;  // stereo: one per keypoint [px], kNoRightMatch where there is none; mono: empty
  // Stereo: what was taken out of u_right for an imperfect rectification [px]; none where that is
  // not known (a keyframe of another run).
  std::optional<double> disparity_offset;
  // Features that are no longer here, since Map::drop_features() or before the map was saved.
  std::uint32_t dropped = 0;

  std::size_t size() const { return features.size(); }
  bool has_right(std::size_t keypoint) const {
    return !u_right.empty() && !std::isnan(u_right[keypoint]);
  }
};

}  // namespace hybrid_slam
