#pragma once

#include <cstddef>

#include "frontend/matching/projection_matcher.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {

// A frame of a synthetic scene as matching and relocalization see an image, with its truth. The
// scene must outlive it.
class FrameView {
 public:
  FrameView(const SyntheticScene& scene, std::size_t frame)
      : frame_(scene.frames[frame]),
        camera_(scene.cameras[frame_.observations->camera.value]),
        features_(frame_.observations->features),
        u_right_(frame_.observations->u_right),
        grid_(features_.keypoints, image_width(camera_), image_height(camera_)) {}

  FeatureView view() const { return {camera_, features_, u_right_, grid_}; }
  const Camera& camera() const { return camera_; }
  const Rigid3d& true_pose() const { return frame_.cam_from_world; }

  // For tests that spoil what was measured; not the positions of the left keypoints.
  FeatureSet& features() { return features_; }
  std::vector<float>& u_right() { return u_right_; }

  // The landmark of the map that the keypoint truly shows; invalid if there is none.
  LandmarkId truth(const FilledMap& filled, std::size_t keypoint) const {
    const int landmark = frame_.landmark[keypoint];
    return landmark < 0 ? LandmarkId() : filled.landmarks[static_cast<std::size_t>(landmark)];
  }
  std::size_t size() const { return features_.size(); }

 private:
  const SyntheticFrame& frame_;
  Camera camera_;
  FeatureSet features_;
  std::vector<float> u_right_;
  KeypointGrid grid_;
};

}  // namespace hybrid_slam
