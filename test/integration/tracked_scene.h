#pragma once

#include <optional>

#include "cameras/geometry/uncertain_motion.h"
#include "frontend/tracking/tracked_frame.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {

// What tracking says of the last moment of a scene.
struct TrackedMoment {
  TrackedFrame stereo;
  TrackedFrame fisheye;
  std::optional<UncertainMotion> left_from_fisheye;  // where both were tracked
  bool known = false;                                // all of it, against the map's origin
};

// Tracks and maps a scene with a stereo pair, and perhaps a fisheye, frame by frame, with the steps
// of the pipeline and without loops.
TrackedMoment track_scene(const SyntheticScene& scene);

// d^T covariance^-1 d / 6 of the left perturbation d that leads from an estimate to the truth.
double normalized_error(const UncertainMotion& estimate, const Rigid3d& truth);

}  // namespace hybrid_slam
