#pragma once

#include <optional>
#include <vector>

#include "apps/scene_renderer/rig_motion.h"

namespace hybrid_slam {

// The images of one moment.
struct RenderedFrame {
  ColorImage left, right;
  std::optional<ColorImage> fish;
};

// How much of what the left camera sees the fisheye sees, too.
struct CommonView {
  double in_view = 0;  // share of the left image's surface in the fisheye's view, nothing between
  double visible = 0;  // of that share, what the water lets through
};

// A whole sequence: seafloor, motion and cameras, of which any frame can be rendered. Depends on
// options and image size alone.
class SceneSequence {
 public:
  SceneSequence(const SceneOptions& options, const SceneCameras& cameras, int threads);

  const SceneOptions& options() const { return options_; }
  const SceneCameras& cameras() const { return cameras_; }
  const std::vector<RigMoment>& motion() const { return motion_; }
  const RayCaster& seafloor() const { return seafloor_; }

  RenderedFrame render(int frame) const;

  // Of a frame of a hybrid sequence.
  CommonView common_view(int frame) const;

 private:
  Lighting lighting_at(const RigMoment& moment) const;
  RadianceImage expose(const SceneMoment& moment, const Camera& camera, const ViewRays& rays,
                       const Rigid3d& world_from_cam, double time, int frame, int view) const;
  std::uint32_t seed_of(int frame, int view) const;

  SceneOptions options_;
  SceneCameras cameras_;
  int threads_;
  RayCaster seafloor_;
  std::vector<RigMoment> motion_;
  Camera pinhole_;
  ViewRays stereo_rays_, fisheye_rays_;
};

}  // namespace hybrid_slam
