#pragma once

#include <cstddef>
#include <utility>

#include "frontend/tracking/frame.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

// The left keypoints of a synthetic stereo frame, and the right ones that match them.
inline StereoFeatures stereo_features(const FrameObservations& observations) {
  StereoFeatures features;
  features.left = observations.features;
  features.u_right = observations.u_right;
  features.right.kind = features.left.kind;
  features.right_of_left.assign(features.left.size(), -1);
  for (std::size_t i = 0; i < features.left.size(); ++i) {
    if (observations.has_right(i)) {
      features.right_of_left[i] = static_cast<int>(features.right.size());
      Keypoint right = features.left.keypoints[i];
      right.x = observations.u_right[i];
      features.right.keypoints.push_back(right);
      features.right.descriptors.push_back(features.left.descriptors[i]);
    }
  }
  return features;
}

// A stereo frame of a scene, ready to be tracked.
inline Frame stereo_frame(const SyntheticFrame& frame, const Camera& camera) {
  const FrameObservations& observations = *frame.observations;
  return make_frame(observations.frame_index, observations.time, stereo_features(observations),
                    image_width(camera), image_height(camera));
}

// A fisheye's.
inline Frame mono_frame(const SyntheticFrame& frame, const Camera& camera) {
  const FrameObservations& observations = *frame.observations;
  return make_mono_frame(observations.frame_index, observations.time, observations.features,
                         image_width(camera), image_height(camera));
}

// A frame of a scene that has a stereo pair only.
inline Frame stereo_frame(const SyntheticScene& scene, std::size_t index) {
  return stereo_frame(scene.frames[index], scene.cameras.front());
}

}  // namespace hybrid_slam
