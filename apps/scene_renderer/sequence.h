#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "apps/scene_renderer/arm.h"
#include "apps/scene_renderer/film.h"

namespace hybrid_slam {

enum ViewNumber { kLeft, kRight, kFish };

// The images of one moment.
struct RenderedFrame {
  ColorImage left, right;
  std::optional<ColorImage> fish;
  // By pixel of left, right and fish: 1 where any ray meets the arm. Empty if there is no arm.
  std::array<std::vector<std::uint8_t>, 3> arm;
};

// How much of what the left camera sees the fisheye sees, too.
struct CommonView {
  double in_view = 0;  // share of the left image's surface in the fisheye's view, nothing between
  double visible = 0;  // of that share, what the water lets through
};

// What the left camera sees of the ground.
struct GroundView {
  double visible = 0;  // of the ground's light, what gets through silt and past arm and fish; 0
                       // without lamps
  double arm = 0;      // share of the image that the arm covers
  double blur = 0;     // [px] the way of the image's middle during the exposure
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
  const std::vector<FrameFate>& fates() const { return fates_; }  // of the frames in motion()

  // How the stereo pair truly sees.
  const Lens& stereo_lens() const { return stereo_.lens; }
  Rigid3d world_from_right(const RigMoment& moment) const;

  // By pixel of left, right and fish: the share of light that dirt stops. Empty if it is clean.
  const std::vector<float>& dirt(ViewNumber view) const { return dirt_[view]; }

  RenderedFrame render(int frame) const;

  // Of a frame of a hybrid sequence.
  CommonView common_view(int frame) const;

  GroundView ground_view(int frame) const;

 private:
  struct Optics {
    Lens lens{Camera()};
    ViewRays rays;
  };

  // What stands and swims in the light at one time.
  struct Scene {
    RigMoment rig;
    std::unique_ptr<RayCaster> movers;
    SceneMoment moment;
  };
  using Scenes = std::map<double, Scene>;  // by time

  const Optics& optics_of(ViewNumber view) const { return view == kFish ? fisheye_ : stereo_; }
  Rigid3d pose_of(ViewNumber view, const RigMoment& rig) const;
  std::uint32_t seed_of(int number, ViewNumber view) const;
  Lighting lighting_at(const RigMoment& moment) const;
  const Scene& scene_at(double time, Scenes& scenes) const;
  double image_way(ViewNumber view, double time, const Eigen::Vector2d& pixel) const;
  int snapshots_for(ViewNumber view, double time) const;
  RadianceImage snapshot(ViewNumber view, const Scene& scene, std::uint32_t seed) const;
  RadianceImage expose(ViewNumber view, const RigMoment& rig, Scenes& scenes) const;

  SceneOptions options_;
  SceneCameras cameras_;
  int threads_;
  RayCaster seafloor_;
  RigMotion rig_motion_;
  std::vector<FrameFate> fates_;
  std::vector<RigMoment> motion_;
  Optics stereo_, fisheye_;
  std::array<std::vector<float>, 3> dirt_;
  ArmShape arm_;
  FilmOptions film_;
};

}  // namespace hybrid_slam
