#include "frontend/tracking/frame.h"

#include <utility>

namespace hybrid_slam {

Frame make_frame(std::int64_t index, double time, StereoFeatures features, int width, int height) {
  KeypointGrid grid(features.left.keypoints, width, height);
  const std::size_t size = features.left.size();
  return {.index = index,
          .time = time,
          .features = std::move(features),
          .grid = std::move(grid),
          .image = nullptr,
          .cam_from_world = Rigid3d(),
          .landmarks = std::vector<LandmarkId>(size),
          .width = width,
          .height = height};
}

Frame make_mono_frame(std::int64_t index, double time, FeatureSet features, int width, int height) {
  StereoFeatures single;
  single.left = std::move(features);
  return make_frame(index, time, std::move(single), width, height);
}

std::shared_ptr<FrameObservations> make_observations(CameraId camera, const Frame& frame) {
  auto observations = std::make_shared<FrameObservations>();
  observations->camera = camera;
  observations->frame_index = frame.index;
  observations->time = frame.time;
  observations->features = frame.features.left;
  observations->u_right = frame.features.u_right;
  if (!frame.features.u_right.empty()) observations->disparity_offset = frame.u_right_correction;
  return observations;
}

}  // namespace hybrid_slam
