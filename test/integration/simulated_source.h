#pragma once

#include <set>
#include <utility>

#include "apps/pipeline/frame_source.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

// The stereo frames of a synthetic scene as a source of frames: tracking and mapping without
// images.
class SimulatedSource final : public FrameSource {
 public:
  explicit SimulatedSource(SyntheticScene scene) : scene_(std::move(scene)) {}

  std::size_t size() const override { return scene_.frames.size(); }
  const Calibrated<RectifiedStereo>& camera() const override {
    return std::get<Calibrated<RectifiedStereo>>(scene_.cameras.front());
  }
  std::unique_ptr<FrameLoader> make_loader() const override;

  const SyntheticScene& scene() const { return scene_; }

  std::set<std::size_t> corrupt;  // indices that cannot be read
  std::set<std::size_t> blank;    // indices without a single feature

 private:
  SyntheticScene scene_;
};

}  // namespace hybrid_slam
