#include <algorithm>
#include <cstdio>
#include <numbers>
#include <vector>

#include <ceres/manifold.h>
#include <ceres/sphere_manifold.h>

#include "backend/problem/solve_graph.h"
#include "cameras/geometry/se3.h"
#include "factors/left_jacobian.h"
#include "factors/make_reprojection_factor.h"
#include "factors/manifolds.h"
#include "factors/pose_prior.h"
#include "factors/relative_pose_factor.h"
#include "factors/transform_error.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/backend/incremental/scene_graph.h"
#include "test/backend/mixed_graphs/inertial_chain.h"
#include "test/backend/mixed_graphs/test_factors.h"
#include "test/support/factor_check.h"
#include "test/support/random.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

IncrementalOptions exact() {
  IncrementalOptions options;
  options.relinearization = 1e-12;
  options.worst_mismatch = 1e-6;
  options.wildfire = 1e-12;
  options.block_wildfire = 1e-9;
  options.budget = 1e12;
  return options;
}

// Feeds a graph and compares every fifth update, and the last, with the optimum.
void check_stream(const FactorGraph& graph, double median, double worst) {
  MixedFeed feed(graph, {});
  std::vector<double> excesses;
  const auto count = static_cast<std::uint32_t>(graph.frames.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    feed.feed_next();
    if (i > 1 && (i % 5 == 1 || i + 1 == count)) excesses.push_back(excess(feed.solver()));
  }
  std::sort(excesses.begin(), excesses.end());
  std::printf("%zu comparisons: median %.2g, worst %.2g above the optimum\n", excesses.size(),
              excesses[excesses.size() / 2], excesses.back());
  CHECK(excesses.front() > -1e-6);
  CHECK(excesses[excesses.size() / 2] < median);
  CHECK(excesses.back() < worst);
}

// A stereo scene whose observations see a calibration that all share, the baseline excepted.
FactorGraph calibration_graph(int times) {
  SyntheticSceneOptions options;
  options.times = times;
  options.step = 0.3;
  options.landmarks = 150;
  FactorGraph graph = scene_graph(options);
  disturb(graph, 0.01, 0.005, 0.03, 3);
  const auto& camera = std::get<Calibrated<RectifiedStereo>>(graph.cameras[0].camera);
  GraphBlock calibration;
  calibration.values = Eigen::Map<const Eigen::VectorXd>(camera.params.data(), 5);
  calibration.values.head<4>() += Eigen::Vector4d(3, -2, 1, 2);
  calibration.manifold = std::make_shared<ceres::SubsetManifold>(5, std::vector<int>{4});
  calibration.shared = true;
  graph.blocks.push_back(calibration);
  const Eigen::Matrix<double, 5, 1> start = calibration.values;
  graph.factors.push_back({value_factor<5>(start, 5), {block_variable(0)}});
  std::vector<int> stereo(graph.points.size(), 0);
  for (const GraphObservation& seen : graph.observations) {
    if (!std::isnan(seen.measurement[2])) stereo[seen.point] = 1;
  }
  std::vector<int> begun(graph.points.size(), 0);
  for (const GraphObservation& seen : graph.observations) {
    // Of a point that is first seen without a right match only what comes after.
    if (begun[seen.point] == 0 && std::isnan(seen.measurement[2])) continue;
    begun[seen.point] = 1;
    graph.factors.push_back(
        {make_refining_reprojection_factor(graph.cameras[0].camera, seen.measurement, seen.sigma),
         {pose_variable(seen.frame), point_variable(seen.point), block_variable(0)}});
  }
  graph.observations.clear();
  return graph;
}

// Poses by odometry that turn about a direction all of them see, on the sphere, from a bad start.
FactorGraph direction_graph() {
  InertialChainOptions options;
  options.poses = 40;
  InertialChain chain = inertial_chain(options);
  Random random(8);
  const Eigen::Vector3d truth = Eigen::Vector3d(0.2, -1, 0.3).normalized();
  GraphBlock direction;
  direction.values = Eigen::Vector3d(0.7, -0.9, -0.4).normalized();
  direction.manifold = std::make_shared<ceres::SphereManifold<3>>();
  const auto index = static_cast<std::uint32_t>(chain.graph.blocks.size());
  chain.graph.blocks.push_back(direction);
  for (std::uint32_t i = 0; i < chain.truth.size(); ++i) {
    const Eigen::Vector3d seen = chain.truth[i].rotation() * truth + random.gaussian3(0.02);
    chain.graph.factors.push_back(
        {direction_factor(seen, 0.02), {pose_variable(i), block_variable(index)}});
  }
  return chain.graph;
}

TEST_CASE("mixed graphs: incremental equals batch") {
  InertialChainOptions options;
  SECTION("a chain with blocks of velocity and bias") {
    check_stream(inertial_chain(options).graph, 1e-4, 1e-3);
  }
  SECTION("the same with ranges to beacons") {
    options.ranges = 4;
    check_stream(inertial_chain(options).graph, 1e-4, 1e-3);
  }
  SECTION("velocities in the world that do not turn along") {
    options.world_vectors = false;
    check_stream(inertial_chain(options).graph, 1e-4, 1e-3);
  }
  SECTION("a calibration that every landmark sees") {
    check_stream(calibration_graph(25), 1e-3, 5e-3);
  }
  SECTION("a direction on the sphere") { check_stream(direction_graph(), 1e-4, 1e-3); }
}

TEST_CASE("mixed graphs: with no tolerance, the optimum to the last digits") {
  InertialChainOptions options;
  options.poses = 30;
  options.ranges = 2;
  for (const FactorGraph& graph :
       {inertial_chain(options).graph, calibration_graph(8), direction_graph()}) {
    MixedFeed feed(graph, exact());
    while (!feed.done()) feed.feed_next();
    for (int i = 0; i < 5; ++i) feed.solver().update();
    CHECK(std::abs(excess(feed.solver())) < 1e-7);
  }
}

// Nothing but the calibration is measured anew, so that all else is old terms, which have to
// notice.
TEST_CASE("mixed graphs: landmarks follow a calibration that moves far") {
  MixedFeed feed(calibration_graph(12), {});
  while (!feed.done()) feed.feed_next();
  IncrementalSolver& solver = feed.solver();
  Eigen::Matrix<double, 5, 1> elsewhere = solver.block(0);
  elsewhere.head<4>() += Eigen::Vector4d(40, 30, -20, 20);
  solver.add_factor({value_factor<5>(elsewhere, 0.1), {block_variable(0)}});
  for (int i = 0; i < 10; ++i) solver.update();
  CHECK(std::abs(excess(solver)) < 1e-3);
}

// Half the squared residuals of what joins poses, without what holds one of them.
double inner_cost(FactorGraph graph) {
  std::erase_if(graph.factors, [](const GraphFactor& f) { return f.variables.size() == 1; });
  return cost(graph);
}

TEST_CASE("mixed graphs: a loop that turns all of a chain leaves what is inside as it is") {
  InertialChainOptions options;
  options.poses = 1000;
  options.laps = 3;
  options.loops = false;
  options.anchor = false;
  options.noise = 0.01;  // so that Gauss-Newton finds the optimum to the last digits
  MixedFeed feed(inertial_chain(options).graph, exact());
  IncrementalSolver& solver = feed.solver();
  feed.add_next();
  const Matrix6d information = 1e4 * Matrix6d::Identity();
  const std::uint32_t held = solver.add_factor(
      {std::make_shared<PosePrior>(solver.pose(0), information), {pose_variable(0)}});
  while (!feed.done()) feed.feed_next();
  for (int i = 0; i < 10; ++i) solver.update();
  const FactorGraph before = solver.graph();
  const Rigid3d turn(Eigen::Quaterniond(Eigen::AngleAxisd(20 * std::numbers::pi / 180,
                                                          Eigen::Vector3d(1, 2, -1).normalized())),
                     {1, -2, 0.5});
  solver.remove_factor(held);
  solver.add_factor(
      {std::make_shared<PosePrior>(solver.pose(0) * turn, information), {pose_variable(0)}});
  for (int i = 0; i < 10; ++i) solver.update();
  const FactorGraph after = solver.graph();
  const Rigid3d way = inverse(before.frames[999].cam_from_world) * after.frames[999].cam_from_world;
  const double angle = Eigen::AngleAxisd(way.rotation()).angle() * 180 / std::numbers::pi;
  CHECK(angle == Approx(20).epsilon(1e-6));
  CHECK(std::abs(inner_cost(after) - inner_cost(before)) < 1e-9 * inner_cost(before));
  const Eigen::Vector3d turned =
      way.rotation().conjugate() * Eigen::Vector3d(before.blocks[999].values.head<3>());
  CHECK((solver.block(999).head<3>() - turned).norm() < 1e-7);
}

struct RelativePoseError {
  Rigid3d b_from_a;
  template <typename T>
  bool operator()(const T* a, const T* b, T* residual) const {
    using Quaternion = Eigen::Quaternion<T>;
    const Eigen::Map<const Quaternion> q_a(a);
    const Eigen::Map<const Quaternion> q_b(b);
    const Quaternion measured = b_from_a.rotation().cast<T>();
    const Vector3<T> shift = b_from_a.translation().cast<T>();
    const Quaternion rotation = measured * q_a * q_b.conjugate();
    const Vector3<T> t_a = measured * Vector3<T>(Eigen::Map<const Vector3<T>>(a + 4)) + shift;
    const Vector3<T> place = t_a - rotation * Vector3<T>(Eigen::Map<const Vector3<T>>(b + 4));
    Eigen::Map<Vector3<T>>{residual} = place;
    const T sign(rotation.w() < T(0) ? -2 : 2);
    Eigen::Map<Vector3<T>>{residual + 3} = sign * rotation.vec();
    return true;
  }
};

TEST_CASE("mixed graphs: derivatives by a pose's numbers become those by its perturbation") {
  Random random(4);
  const PoseManifold manifold;
  for (int i = 0; i < 20; ++i) {
    const Rigid3d a = random.rigid(3, 3);
    const Rigid3d b = random.rigid(3, 3);
    const Rigid3d a_from_b = a * inverse(b) * random.rigid(0.2, 0.3);
    const RelativePoseFactor analytic(a_from_b, Matrix6d::Identity());
    const auto automatic =
        std::make_shared<ceres::AutoDiffCostFunction<RelativePoseError, 6, 7, 7>>(
            new RelativePoseError{inverse(a_from_b)});
    const auto lifted = left_jacobian(automatic, {1, 1});
    CHECK(lifted != automatic);
    const std::vector<FactorBlock> blocks{{a.params, &manifold}, {b.params, &manifold}};
    const FactorEvaluation wanted = evaluate(analytic, blocks);
    const FactorEvaluation found = evaluate(*lifted, blocks);
    CHECK((wanted.residual - found.residual).norm() < 1e-12);
    for (int k = 0; k < 2; ++k) {
      CHECK((wanted.jacobians[k] - found.jacobians[k]).norm() < 1e-12);
      CHECK(found.jacobians[k].col(6).norm() == 0);
    }
  }
  // Those of this project have it already.
  const auto own = std::make_shared<RelativePoseFactor>(Rigid3d(), Matrix6d::Identity());
  CHECK(left_jacobian(own, {1, 1}) == own);
}

}  // namespace
}  // namespace hybrid_slam
