#include "frontend/tracking/uncertain_pose.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "backend/incremental/incremental_solver.h"
#include "factors/reprojection.h"
#include "test/support/filled_map.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

// Poses and points at the optimum of all that keyframes see, the covariances that the map then
// knows, and two more frames of the scene.
struct Optimised {
  SyntheticScene scene;
  FilledMap filled;
  IncrementalSolver solver{IncrementalOptions()};
  std::vector<std::uint32_t> point_of;  // by landmark of the scene

  static SyntheticSceneOptions options() {
    SyntheticSceneOptions made;
    made.trajectory = SceneTrajectory::kHover;
    made.times = 8;
    made.landmarks = 400;
    return made;
  }

  Optimised() : scene(make_synthetic_scene(options())) {
    SyntheticScene mapped = scene;
    mapped.frames.resize(6);
    filled = fill_map(mapped, {});
    solve();
  }

  const MapSnapshot& map() const { return filled.map.view(); }

  void solve() {
    solver.add_camera(scene.cameras[0]);
    for (const KeyframeId id : filled.keyframes) {
      solver.add_pose({map().at(id).cam_from_world, 0, id == map().origin()});
    }
    for (const LandmarkId id : filled.landmarks) {
      point_of.push_back(id.valid() ? solver.add_point(map().at(id).point_in_world) : 0);
      if (!id.valid()) continue;
      for (const Observation& seen : map().at(id).observations) {
        const FrameObservations& frame = *map().at(seen.keyframe).observations;
        const Keypoint& keypoint = frame.features.keypoints[seen.keypoint];
        solver.add_observation({seen.keyframe.value,
                                point_of.back(),
                                {keypoint.x, keypoint.y, frame.u_right[seen.keypoint]},
                                keypoint.sigma});
      }
    }
    for (int i = 0; i < 5; ++i) solver.update();
    std::vector<std::pair<KeyframeId, Rigid3d>> poses;
    for (const KeyframeId id : filled.keyframes) poses.emplace_back(id, solver.pose(id.value));
    std::vector<std::pair<LandmarkId, Eigen::Vector3d>> points;
    for (std::size_t i = 0; i < filled.landmarks.size(); ++i) {
      if (filled.landmarks[i].valid()) {
        points.emplace_back(filled.landmarks[i], solver.point(point_of[i]));
      }
    }
    filled.map.move(poses, points);
  }

  void tell_covariances() {
    auto found = solver.paths({0, 1, 2, 3, 4, 5}, static_cast<std::size_t>(-1));
    std::vector<KeyframeCovariances::Known> known;
    for (const auto& pose : found.poses) {
      known.push_back({KeyframeId(pose.pose), pose.at, pose.by_variable});
    }
    filled.map.set_covariances(std::make_shared<const KeyframeCovariances>(
        map().origin(), std::move(found.paths), std::move(known)));
  }

  Frame frame(std::size_t index) const {
    Frame made = stereo_frame(scene, index);
    made.cam_from_world = scene.frames[index].cam_from_world;
    for (std::size_t i = 0; i < made.size(); ++i) {
      const int landmark = scene.frames[index].landmark[i];
      if (landmark >= 0) made.landmarks[i] = filled.landmarks[static_cast<std::size_t>(landmark)];
    }
    return made;
  }

  UncertainPose uncertain(std::size_t index) const {
    return uncertain_pose(map(), scene.cameras[0], CameraId(0), frame(index), KeyframeId(5), {});
  }
};

// The same written down once more: all landmarks of the scene, with their joint covariance.
struct ByAllPoints {
  Matrix6d noise = Matrix6d::Zero();
  Eigen::MatrixXd by_points;  // of the left perturbation
};

ByAllPoints by_all_points(const Optimised& world, std::size_t index) {
  const Frame frame = world.frame(index);
  const auto& camera = std::get<Calibrated<RectifiedStereo>>(world.scene.cameras[0]);
  const PoseRefinementOptions options;
  Matrix6d information = Matrix6d::Zero();
  ByAllPoints result;
  result.by_points = Eigen::MatrixXd::Zero(6, 3 * static_cast<Eigen::Index>(world.point_of.size()));
  for (std::size_t i = 0; i < frame.size(); ++i) {
    if (!frame.landmarks[i].valid()) continue;
    const auto landmark = world.scene.frames[index].landmark[i];
    const Eigen::Vector3d point = world.map().at(frame.landmarks[i]).point_in_world;
    const Keypoint& keypoint = frame.features.left.keypoints[i];
    const float u_right = frame.features.u_right[i];
    const double measurement[3] = {keypoint.x, keypoint.y, u_right};
    const int rows = std::isnan(u_right) ? 2 : 3;
    double residual[3];
    Eigen::Matrix<double, 3, 6, Eigen::RowMajor> by_pose = decltype(by_pose)::Zero();
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_point = decltype(by_point)::Zero();
    const auto residual_of =
        rows == 3 ? reprojection_residual<RectifiedStereo> : reprojection_residual<Pinhole>;
    REQUIRE(residual_of(camera.params.data(), frame.cam_from_world.params.data(), point.data(),
                        measurement, 1 / keypoint.sigma, residual, by_pose.data(), by_point.data(),
                        nullptr));
    const double weight =
        inlier_efficiency(rows, rows == 3 ? options.chi2_stereo : options.chi2_mono);
    information += weight * by_pose.transpose() * by_pose;
    result.by_points.middleCols<3>(3 * landmark) -= weight * by_pose.transpose() * by_point;
  }
  result.noise = information.inverse();
  result.by_points = result.noise * result.by_points;
  return result;
}

// The covariance of the points that are there; zero of others.
Eigen::MatrixXd covariance_of_points(const Optimised& world) {
  std::vector<GraphVariable> variables;
  std::vector<Eigen::Index> rows;
  for (std::size_t i = 0; i < world.point_of.size(); ++i) {
    if (!world.filled.landmarks[i].valid()) continue;
    variables.push_back({GraphVariable::Kind::kPoint, world.point_of[i]});
    for (int k = 0; k < 3; ++k) rows.push_back(3 * static_cast<Eigen::Index>(i) + k);
  }
  const auto all = 3 * static_cast<Eigen::Index>(world.point_of.size());
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(all, all);
  covariance(rows, rows) = world.solver.covariance(variables);
  return covariance;
}

// The largest and smallest ratio of the variances that two covariances have of anything.
Eigen::Vector2d variance_ratios(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> solver(a, b,
                                                                         Eigen::EigenvaluesOnly);
  return {solver.eigenvalues().minCoeff(), solver.eigenvalues().maxCoeff()};
}

TEST_CASE("What a frame is off by has all that its landmarks are off by, jointly") {
  Optimised world;
  world.tell_covariances();
  const Eigen::MatrixXd points = covariance_of_points(world);
  const ByAllPoints a = by_all_points(world, 6);
  const ByAllPoints b = by_all_points(world, 7);

  TrackedFrame tracked;
  write_covariance(world.map(), world.uncertain(6), tracked);
  const Matrix6d expected = a.noise + a.by_points * points * a.by_points.transpose();
  // Distances that views leave open are bounded by our code alone: that is the difference.
  const Eigen::Vector2d ratios = variance_ratios(tracked.covariance, expected);
  CHECK(ratios[0] > 0.99);
  CHECK(ratios[1] < 1.01);
  CHECK(tracked.covariance_base == world.map().origin());
  CHECK(variance_ratios(a.noise, expected)[0] < 0.7);  // the rest is no trifle

  const UncertainMotion motion = relative_pose(world.map(), world.uncertain(6), world.uncertain(7));
  const Matrix6d carry = adjoint(motion.b_from_a);
  const Eigen::MatrixXd by_points = a.by_points - carry * b.by_points;
  const Matrix6d relative =
      a.noise + carry * b.noise * carry.transpose() + by_points * points * by_points.transpose();
  const Eigen::Vector2d of_relative = variance_ratios(motion.covariance, relative);
  CHECK(of_relative[0] > 0.99);
  CHECK(of_relative[1] < 1.01);
}

TEST_CASE("Where the map knows no covariances, a frame's is against a keyframe") {
  Optimised world;
  TrackedFrame unknown;
  write_covariance(world.map(), world.uncertain(6), unknown);
  CHECK(unknown.covariance_base.valid());
  const Matrix6d noise = by_all_points(world, 6).noise;
  CHECK(variance_ratios(unknown.covariance, noise)[0] > 1);  // landmarks are not exact
  const UncertainMotion apart = relative_pose(world.map(), world.uncertain(6), world.uncertain(7));
  CHECK(apart.covariance.allFinite());
  world.tell_covariances();
  TrackedFrame known;
  write_covariance(world.map(), world.uncertain(6), known);
  CHECK(variance_ratios(known.covariance, unknown.covariance)[0] > 1);
}

TEST_CASE("Along odometry its covariance comes on top") {
  Optimised world;
  world.tell_covariances();
  const UncertainMotion motion{se3_exp(Vector6d(0.1, -0.2, 0.3, 0.4, 0.1, -0.2)),
                               Vector6d(1e-6, 2e-6, 3e-6, 4e-7, 5e-7, 6e-7).asDiagonal()};
  TrackedFrame before, after;
  const UncertainPose pose = world.uncertain(6);
  write_covariance(world.map(), pose, before);
  write_covariance(world.map(), moved(pose, motion, 7), after);
  const Matrix6d expected = (motion * UncertainMotion{Rigid3d(), before.covariance}).covariance;
  CHECK((after.covariance - expected).norm() < 1e-9 * expected.norm());
  CHECK(after.covariance_base == before.covariance_base);
}

// Ground to which a frame came back as a keyframe is what that keyframe is off by.
TEST_CASE("A frame that became a keyframe is off by what that is off by") {
  Optimised world;
  world.tell_covariances();
  const UncertainPose pose = UncertainPose::of_keyframe(CameraId(0), 5, KeyframeId());
  TrackedFrame frame;
  write_covariance(world.map(), present(world.map(), pose), frame);
  const Matrix6d expected = *world.map().keyframe_covariance(KeyframeId(5));
  CHECK((frame.covariance - expected).norm() < 1e-9 * expected.norm());
  const UncertainMotion still = relative_pose(world.map(), pose, pose);
  CHECK(still.covariance.norm() < 1e-12 * expected.norm());
}

}  // namespace
}  // namespace hybrid_slam
