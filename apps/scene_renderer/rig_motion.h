#pragma once

#include <optional>
#include <vector>

#include "apps/scene_renderer/ray_caster.h"
#include "apps/scene_renderer/scene_options.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// Where the cameras are at one moment, and what the hard preset does to the fisheye.
struct RigMoment {
  double time = 0;  // [s]
  Rigid3d world_from_left;
  std::optional<Rigid3d> world_from_fish;  // hybrid sequences only
  float silt = 0;                          // 0 to 1: strength of the cloud about the fisheye
  bool turned_away = false;                // the wrist looks away from the ground
  Rigid3d world_from_hand;                 // of the arm: the fisheye's frame if there is one
  int number = 0;                          // of the frame at this time, dropped ones counted
};

// How far from the origin the motion's cameras look at the ground [m].
double survey_radius(const SceneOptions& options);

// The rig's motion as a function of time. Hybrid: the vehicle hovers about 1.9 m from the scene's
// middle and sways; the wrist sweeps between 0.4 and 1.5 m ahead of it and looks at what the stereo
// pair sees, from all its sides, at least 0.3 m above the ground. Survey: a spiral at 1.5 m, then
// arms across it, at 0.055 m per frame or as the width asks for; at another visit turned by 0.2 to
// 0.7 rad, shifted by 0.2 to 0.4 m (at most a quarter of the radius), and a quarter and the shift
// narrower.
class RigMotion {
 public:
  RigMotion(const SceneOptions& options, const RayCaster& seafloor);

  // At any time [s], also between frames and before the first; a survey stands still there.
  RigMoment at(double time) const;

 private:
  RigMoment hybrid_at(double time) const;
  RigMoment survey_at(double time) const;

  SceneOptions options_;
  double lift_ = 0;                    // [m] of the wrist's sweep, off the ground
  double step_ = 0;                    // [m] of a survey from frame to frame
  std::vector<Eigen::Vector2d> path_;  // of a survey, closer to each other than its frames
};

// The motion at each of the sequence's frames, without dropped ones.
std::vector<RigMoment> make_motion(const SceneOptions& options, const RayCaster& seafloor);

}  // namespace hybrid_slam
