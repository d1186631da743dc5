#pragma once

#include <string>

#include "frontend/input/image_sequence.h"

namespace hybrid_slam {

// Compares the trajectories of a hybrid run, stereo.tum and fisheye.tum in the folder `estimate`,
// with `truth`: a UWslam sequence's folder, or its camera_poses.txt, beside which its times lie.
// Prints the outcome. Throws InputError.
void evaluate_hybrid(const std::string& estimate, const std::string& truth,
                     TruthConvention convention, double max_difference, bool json);

}  // namespace hybrid_slam
