// An incremental graph with a factor of one's own: the range to a beacon. Component: backend.
#include <ceres/autodiff_cost_function.h>
#include <hybrid_slam/backend/incremental/incremental_solver.h>
#include <cstdio>

using namespace hybrid_slam;

struct BeaconRange {
  double range, sigma;  // [m]
  template <typename T>
  bool operator()(const T* pose, const T* beacon, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(pose);  // of cam_from_world: x y z w
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t(pose + 4), at(beacon);
    residual[0] = ((q * at + t).norm() - T(range)) / T(sigma);
    return true;
  }
};
using RangeFactor = ceres::AutoDiffCostFunction<BeaconRange, 1, 7, 3>;

int main() {
  const Eigen::Vector3d truth(4, 3, 8);
  IncrementalSolver solver{IncrementalOptions()};
  const auto beacon = solver.add_block({.values = Eigen::Vector3d(3, 2, 9)});
  Rigid3d last_from_world;
  for (int i = 0; i < 12; ++i) {  // round a bend, so that three coordinates can be told
    const Rigid3d cam_from_world({1, 0, 0, 0}, -Eigen::Vector3d(0.5 * i, 0.1 * i * i, i % 3));
    const auto pose = solver.add_pose({.cam_from_world = cam_from_world, .fixed = i == 0});
    const Rigid3d motion = last_from_world * inverse(cam_from_world);
    if (pose > 0) solver.add_edge({pose - 1, pose, motion, 1e4 * Matrix6d::Identity()});
    const double range = (cam_from_world * truth).norm();
    solver.add_factor({.function = std::make_shared<RangeFactor>(new BeaconRange{range, 0.1}),
                       .variables = {pose_variable(pose), block_variable(beacon)}});
    solver.update();
    last_from_world = cam_from_world;
  }
  const Eigen::Vector3d found = solver.block(beacon);
  const double off = std::sqrt(solver.covariance({block_variable(beacon)}).trace());
  std::printf("beacon at %.2f %.2f %.2f, +- %.2f m\n", found.x(), found.y(), found.z(), off);
  return (found - truth).norm() < 0.01 ? 0 : 1;
}
