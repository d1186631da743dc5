#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frontend/input/image_sequence.h"

namespace hybrid_slam {

enum class QuaternionOrder { kUnknown, kXyzw, kWxyz };

// Poses as a text file has them, ascending in time.
struct TrajectoryFile {
  std::vector<StampedPose> poses;
  bool has_times = false;             // if not, the times are 0, 1, 2, ...
  std::vector<std::string> notes;     // how it was read, where that is not plain
  std::vector<std::string> warnings;  // what was left out
};

// Columns, blanks or commas between them:
//    8  t, position, quaternion: TUM (x y z w) or, as in EuRoC's csv files, w x y z
//   17  EuRoC's truth: the same with w x y z, then velocity and biases
//   12  KITTI: 3x4 row-major, no times
// The quaternion's order is `order`, or what a header says (a comment or a first line of words), or
// else the custom: of 8 columns with times in seconds TUM's, in whole nanoseconds between commas
// EuRoC's, in nanoseconds with a fraction ORB-SLAM3's (x y z w). Where neither tells, or the first
// rotation is none at all in the other order only, the file is refused. Times beyond
// kLeastNanoseconds, or whole numbers below a header with "[ns]", become seconds.
//
// Of poses at the same time the first stays. Throws InputError naming file and line if there is no
// pose, a line has another number of columns than the first, a value is not finite, a rotation is
// none, or times descend.
TrajectoryFile read_trajectory(const std::filesystem::path& path,
                               QuaternionOrder order = QuaternionOrder::kUnknown);

// The same of a truth file in EuRoC's layout: nanoseconds, position, quaternion (w x y z unless a
// header names another order), and whatever follows.
TrajectoryFile read_euroc_poses(const std::filesystem::path& path);

}  // namespace hybrid_slam
