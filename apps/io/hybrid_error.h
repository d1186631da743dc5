#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "apps/io/trajectory.h"

namespace hybrid_slam {

// The paper's measure of a hybrid run: the pose of the fisheye relative to the left camera, for
// every moment that has both, estimate against truth. Nothing is aligned.
struct HybridError {
  ErrorStatistics translation;  // |dt| [m]
  ErrorStatistics rotation;     // |dq| [rad]
  std::size_t registered = 0;   // fisheye frames of the estimate that have a true pose
  std::size_t total = 0;        // fisheye frames of the truth
};

// All world_from_cam; the worlds of estimate and truth may differ. Poses are associated by time, at
// most `max_difference` [s] apart. None if no moment has all four poses.
std::optional<HybridError> hybrid_error(std::span<const StampedPose> stereo,
                                        std::span<const StampedPose> fisheye,
                                        std::span<const StampedPose> true_stereo,
                                        std::span<const StampedPose> true_fisheye,
                                        double max_difference);

}  // namespace hybrid_slam
