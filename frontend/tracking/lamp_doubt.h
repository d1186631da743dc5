#pragma once

#include <optional>

#include "backend/map/map_snapshot.h"
#include "frontend/tracking/shading_calibrator.h"
#include "frontend/tracking/tracked_frame.h"

namespace hybrid_slam {

// What moving lamps may have pretended of a pose, as far as ShadingCalibrator does not know it.
// What is seen of the ground follows a lamp by a small share of the lamp's way, all of it alike, so
// that a pose is off by that share, however many landmarks it rests on. Lamps go two ways: those of
// the vehicle with the stereo pair, that of the arm with the fisheye.
class LampDoubt {
 public:
  // `arm`: there is a fisheye. How the light divides between vehicle and arm is not known.
  explicit LampDoubt(bool arm) : mean_square_share_(arm ? 1. / 3 : 1) {}

  // Where they are now, in the world.
  void vehicle_at(const Eigen::Vector3d& place) { vehicle_ = place; }
  void arm_at(const Eigen::Vector3d& place) { arm_ = place; }

  // Adds to the frame's covariance the ways since its covariance_base: of the vehicle since that
  // keyframe, of the arm since it was first seen with it.
  void widen(const MapSnapshot& map, const ShadingDoubt& doubt, TrackedFrame& frame);

 private:
  double mean_square_share_;  // of the light, any share being as likely as another
  std::optional<Eigen::Vector3d> vehicle_, arm_, arm_at_base_;
  KeyframeId base_;
};

}  // namespace hybrid_slam
