#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "cameras/geometry/sim3d.h"
#include "frontend/input/image_sequence.h"
#include "frontend/input/trajectory_file.h"

namespace hybrid_slam {

using Trajectory = std::vector<StampedPose>;  // ascending in time

// A line of TUM text: "t tx ty tz qx qy qz qw" [s, m], world_from_cam, with qw >= 0. A pose that
// is not finite is a std::logic_error.
std::string tum_line(const StampedPose& pose);

// A line per pose. Throws OutputError.
void write_tum(const std::filesystem::path& path, std::span<const StampedPose> trajectory);

// A pose of the estimate and that of the truth at the same time, both world_from_cam (the worlds
// may differ).
struct PosePair {
  double time = 0;  // [s], the estimate's
  Rigid3d estimate;
  Rigid3d truth;
};

// Pairs each estimated pose with the nearest truth in time, at most `max_difference` [s] away. No
// truth is used twice: the nearer of two estimates gets it. Ascending in time.
std::vector<PosePair> associate(std::span<const StampedPose> estimate,
                                std::span<const StampedPose> truth, double max_difference);

enum class TrajectoryAlignment { kNone, kSe3, kSim3 };

struct ErrorStatistics {
  std::size_t count = 0;
  double rmse = 0;
  double mean = 0;
  double median = 0;
  double max = 0;
};

ErrorStatistics error_statistics(std::vector<double> errors);

// Absolute trajectory error: distances between the positions of the truth and those of the estimate
// after the best alignment of the whole (Umeyama, PAMI 1991).
struct AbsoluteError {
  ErrorStatistics position;                    // [m]
  Sim3d truth_from_estimate;                   // the alignment that was applied
  double estimated_length = 0;                 // [m], along the paired positions, before alignment
  double true_length = 0;                      // [m]
  std::optional<double> length_ratio() const;  // estimate / truth; none if the truth stands still
};

// None if there are too few pairs to align (none at all; fewer than three for se3 and sim3), or
// for sim3 if the estimate stands still.
std::optional<AbsoluteError> absolute_error(std::span<const PosePair> pairs,
                                            TrajectoryAlignment alignment);

// Relative pose error: the motions over `delta` pairs, each seen from its first camera, compared
// between estimate and truth. `estimate_scale` multiplies the estimate's translations.
struct RelativeError {
  ErrorStatistics translation;  // [m]
  ErrorStatistics rotation;     // [rad]
};

// None if there are not more than `delta` pairs.
std::optional<RelativeError> relative_error(std::span<const PosePair> pairs, std::size_t delta,
                                            double estimate_scale);

}  // namespace hybrid_slam
