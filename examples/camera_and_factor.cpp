// A camera finds its own pose from points that are known. Component: factors.
#include <ceres/ceres.h>
#include <hybrid_slam/cameras/geometry/se3.h>
#include <hybrid_slam/factors/make_reprojection_factor.h>
#include <hybrid_slam/factors/manifolds.h>

#include <cstdio>
#include <vector>

using namespace hybrid_slam;

int main() {
  const Camera camera =
      Calibrated<KannalaBrandt>{{320, 320, 511.5, 511.5, 0.05, -0.01, 0.002, -0.0005}, 1024, 1024};
  const Rigid3d truth(so3_exp({0.1, -0.2, 0.05}), {0.3, 0.1, -0.2});  // cam_from_world

  ceres::Problem problem;
  Rigid3d pose;  // the guess: the identity
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 12; ++i) points.emplace_back(i % 4 - 1.5, i / 4 - 1.0, 2 + 0.3 * (i % 5));
  for (Eigen::Vector3d& point : points) {
    const auto pixel = project(camera, truth * point);
    if (!pixel) continue;
    problem.AddResidualBlock(
        make_reprojection_factor(camera, {pixel->x(), pixel->y(), 0}, 0.5).release(), nullptr,
        pose.params.data(), point.data());
    problem.SetParameterBlockConstant(point.data());
  }
  problem.SetManifold(pose.params.data(), new PoseManifold);

  ceres::Solver::Summary summary;
  ceres::Solve({}, &problem, &summary);
  const double error = se3_log(pose * inverse(truth)).norm();
  std::printf("%s\npose off by %.1e (m, rad)\n", summary.BriefReport().c_str(), error);
  return error < 1e-4 ? 0 : 1;
}
