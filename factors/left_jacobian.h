#pragma once

#include <memory>
#include <vector>

#include <ceres/cost_function.h>

namespace hybrid_slam {

// What a factor's Jacobian by a pose (7 numbers: quaternion x y z w, translation) means:
// - of a factor that derives from LeftJacobian, as those of this project do, the derivative by a
//   left perturbation in the first 6 columns, and zero in the last: see manifolds.h;
// - of every other the derivative by the seven numbers themselves, as a
//   ceres::AutoDiffCostFunction has it.
// Problems are built of the first kind alone; left_jacobian() makes it of the second.
struct LeftJacobian {};

// The function itself if it is of the first kind or has no pose, else one that takes its Jacobians
// by the poses, the blocks with is_pose[k] != 0, through the derivative of exp(delta) * pose.
std::shared_ptr<const ceres::CostFunction> left_jacobian(
    std::shared_ptr<const ceres::CostFunction> function, const std::vector<char>& is_pose);

}  // namespace hybrid_slam
