#pragma once

#include <set>
#include <utility>
#include <vector>

#include "apps/slam/replay.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

// The frames of a synthetic scene with a stereo pair, and perhaps a fisheye, as a source of frames:
// tracking and mapping without images.
class SimulatedSource final : public FrameSource {
 public:
  explicit SimulatedSource(SyntheticScene scene) : scene_(std::move(scene)) {}

  std::size_t size() const override {
    return order.empty() ? scene_.frames.size() / scene_.cameras.size() : order.size();
  }
  CameraRig cameras() const override;
  Nanoseconds time(std::size_t index) const override;
  Moment read(std::size_t index) const override;

  // What is known of the frames of this index.
  const SyntheticFrame& stereo_truth(std::size_t index) const {
    return scene_.frames[moment(index) * scene_.cameras.size()];
  }
  const SyntheticFrame& fisheye_truth(std::size_t index) const {
    return scene_.frames[moment(index) * scene_.cameras.size() + 1];
  }

  const SyntheticScene& scene() const { return scene_; }

  // The scene's moments in the order in which they come, some never, some again; empty: as they
  // are. Frames are numbered and timed as they come.
  std::vector<std::size_t> order;
  std::set<std::size_t> corrupt;          // indices that cannot be read
  std::set<std::size_t> blank;            // indices without a single feature in the stereo pair
  std::set<std::size_t> fisheye_blank;    // likewise, of the fisheye
  std::set<std::size_t> fisheye_missing;  // indices at which the fisheye's image cannot be read

 private:
  ExtractedFrame extracted(CameraKind camera, std::size_t index, Frame frame) const;
  std::size_t moment(std::size_t index) const { return order.empty() ? index : order[index]; }

  SyntheticScene scene_;
};

}  // namespace hybrid_slam
