#pragma once

#include "apps/scene_renderer/rig_motion.h"
#include "apps/scene_renderer/view_rays.h"

namespace hybrid_slam {

// The arm's build, the same at all moments.
struct ArmShape {
  float thickness = 0;  // [m] radius of the upper arm; 0: no arm
  double side = 1;      // of the shoulder: 1 right of the stereo pair, -1 left
};
inline constexpr float kThickestArm = 0.28F;  // [m]

// The vehicle's arm at one moment: an upper arm from below the stereo pair to the elbow, a forearm
// to the hand, and a housing behind the fisheye (if there is none, a hand). Painted with patches
// that go with it.
TriangleMesh make_arm(const RigMoment& moment, const ArmShape& shape);

// Share of the left image's pixels that see the arm, by a grid of 32 x 24 rays.
double arm_share(const RigMoment& moment, const ArmShape& shape, const ViewRays& left_rays);

// An arm that covers a share of the left image in the mean over the motion, if one of at most
// kThickestArm can. Its shoulder is on the side that the hand is less on, so that it reaches
// through the image.
ArmShape fit_arm(double share, const std::vector<RigMoment>& motion, const ViewRays& left_rays);

}  // namespace hybrid_slam
