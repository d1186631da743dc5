#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "backend/map/map_file.h"

namespace hybrid_slam {

// A map file as it is, consistent or not: load_map() without its last check. Throws InputError for
// what is no map file, is damaged, or holds values out of range.
LoadedMap read_map_unchecked(const std::filesystem::path& path);

// What is wrong with a map, one line each; empty: it is sound.
//   references   all of Map::check_consistency(): observations both ways, ids, tree, odometry
//   numbers      poses finite, their rotations orthonormal; points finite
//   views        landmarks in front of the cameras that see them, keypoints inside of the image
//   components   nothing that was measured joins two of them, and what is in one is joined
//   residuals    of keyframes and landmarks, beyond what chance allows
//
// A keyframe's or landmark's residuals are faulty if most of them (more than half) lie beyond the
// optimiser's threshold (95 %: 5.991 for 2 numbers, 7.815 for 3), and their sum of squares has a
// probability below 1e-6 in a map of this size. A camera whose residuals are larger than its sigmas
// say as a whole (an old calibration) sets the measure for its own: the squares are divided by
// what their median says of all, where that is more than 1.
std::vector<std::string> map_faults(const Map& map);

// An upper bound of the probability that chi2 of so many degrees of freedom is exceeded (Chernoff).
double chi2_tail_bound(double chi2, double degrees);

}  // namespace hybrid_slam
