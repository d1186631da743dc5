#include <cmath>
#include <utility>
#include <vector>

#include <ceres/covariance.h>
#include <ceres/problem.h>

#include "backend/problem/problem_builder.h"
#include "cameras/geometry/se3.h"
#include "test/backend/incremental/graph_feed.h"
#include "test/backend/incremental/scene_graph.h"
#include "test/backend/mixed_graphs/inertial_chain.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

IncrementalOptions strict() {
  IncrementalOptions options;
  options.relinearization = 1e-10;
  options.worst_mismatch = 1e-5;
  options.wildfire = 1e-11;
  options.block_wildfire = 1e-8;
  options.budget = 1e12;
  return options;
}

double* data_of(FactorGraph& graph, const GraphVariable& variable) {
  if (variable.kind == GraphVariable::Kind::kPose) {
    return graph.frames[variable.index].cam_from_world.params.data();
  }
  if (variable.kind == GraphVariable::Kind::kPoint) {
    return graph.points[variable.index].in_world.data();
  }
  return graph.blocks[variable.index].values.data();
}

int size_of(const FactorGraph& graph, const GraphVariable& variable) {
  if (variable.kind == GraphVariable::Kind::kPose) return 6;
  if (variable.kind == GraphVariable::Kind::kPoint) return 3;
  return static_cast<int>(graph.blocks[variable.index].values.size());
}

// The joint covariance of all these by Ceres, from the whole problem; poses by their left
// perturbation. Blocks must be vectors.
Eigen::MatrixXd batch_covariance(FactorGraph graph, const std::vector<GraphVariable>& variables) {
  const GraphFactors factors = make_factors(graph);
  CeresGraph built = build_ceres_problem(graph, factors, {}, Loss::kNone);
  ceres::Covariance::Options options;
  options.algorithm_type = ceres::DENSE_SVD;
  ceres::Covariance covariance(options);
  std::vector<std::pair<const double*, const double*>> pairs;
  int rows = 0;
  for (const GraphVariable& a : variables) {
    for (const GraphVariable& b : variables) {
      pairs.emplace_back(data_of(graph, a), data_of(graph, b));
    }
    rows += size_of(graph, a);
  }
  REQUIRE(covariance.Compute(pairs, built.problem.get()));
  Eigen::MatrixXd result(rows, rows);
  int row = 0;
  for (const GraphVariable& a : variables) {
    int column = 0;
    for (const GraphVariable& b : variables) {
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      RowMajor block(size_of(graph, a), size_of(graph, b));
      REQUIRE(covariance.GetCovarianceBlockInTangentSpace(data_of(graph, a), data_of(graph, b),
                                                          block.data()));
      result.block(row, column, block.rows(), block.cols()) = block;
      column += static_cast<int>(block.cols());
    }
    row += size_of(graph, a);
  }
  return result;
}

// Of all entries, relative to the standard deviations.
double mismatch(const Eigen::MatrixXd& found, const Eigen::MatrixXd& wanted) {
  REQUIRE(found.rows() == wanted.rows());
  const Eigen::VectorXd scale = wanted.diagonal().cwiseSqrt().cwiseInverse();
  return (scale.asDiagonal() * (found - wanted) * scale.asDiagonal()).cwiseAbs().maxCoeff();
}

TEST_CASE("covariances: poses and blocks, by themselves and together, are those of the batch") {
  InertialChainOptions options;
  options.poses = 20;
  options.ranges = 2;
  MixedFeed feed(inertial_chain(options).graph, strict());
  while (!feed.done()) feed.feed_next();
  IncrementalSolver& solver = feed.solver();
  for (int i = 0; i < 8; ++i) solver.update();
  const FactorGraph graph = solver.graph();
  const std::vector<std::vector<GraphVariable>> wanted = {
      {pose_variable(19)},
      {block_variable(21)},
      {pose_variable(3), pose_variable(19)},
      {pose_variable(12), block_variable(2 + 12)},
      {block_variable(0), pose_variable(7), block_variable(2 + 19), block_variable(1)}};
  for (const auto& variables : wanted) {
    CHECK(mismatch(solver.covariance(variables), batch_covariance(graph, variables)) < 1e-3);
  }
  CHECK((solver.covariance({pose_variable(19)}) - solver.covariance(19)).norm() == 0);
  solver.set_fixed(pose_variable(5), true);
  solver.update();
  CHECK(solver.covariance({pose_variable(5)}).norm() == 0);
  CHECK_THROWS_AS(solver.covariance({block_variable(99)}), std::logic_error);
}

TEST_CASE("covariances: landmarks, by themselves and with poses, are those of the batch") {
  SyntheticSceneOptions options;
  options.times = 6;
  options.step = 0.4;
  options.landmarks = 60;
  options.missing_right_rate = 0;
  FactorGraph start = scene_graph(options);
  disturb(start, 0.01, 0.005, 0.02, 2);
  GraphFeed feed(start, strict());
  while (!feed.done()) feed.feed_next();
  IncrementalSolver& solver = feed.solver();
  for (int i = 0; i < 8; ++i) solver.update();
  const FactorGraph graph = solver.graph();
  REQUIRE(graph.points.size() > 10);
  const std::vector<std::vector<GraphVariable>> wanted = {
      {point_variable(4)},
      {point_variable(1), point_variable(9)},
      {point_variable(3), pose_variable(5), point_variable(0), pose_variable(2)}};
  for (const auto& variables : wanted) {
    CHECK(mismatch(solver.covariance(variables), batch_covariance(graph, variables)) < 1e-3);
  }
}

}  // namespace
}  // namespace hybrid_slam
