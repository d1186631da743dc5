#include "frontend/tracking/frame.h"

#include <utility>

namespace hybrid_slam {

Frame make_frame(std::int64_t index, double time, StereoFeatures features, int width, int height) {
  KeypointGrid grid(features.left.keypoints, width, height);
  const std::size_t size = features.left.size();
  return {index,   time, std::move(features), std::move(grid),
          nullptr, 0,    Rigid3d(),           std::vector<LandmarkId>(size)};
}

}  // namespace hybrid_slam
