#include "backend/incremental/marginalization.h"

#include <array>
#include <cmath>
#include <map>

#include <Eigen/Cholesky>
#include <Eigen/SVD>

#include "backend/incremental/incremental_solver.h"
#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"
#include "factors/linear_prior.h"
#include "factors/manifolds.h"
#include "test/support/factor_check.h"
#include "test/support/random.h"
#include "test/support/test_cameras.h"

// After Ceres, whose logging has a CHECK of its own.
#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

LinearSystem random_system(Random& random, Eigen::Index rows, Eigen::Index columns) {
  LinearSystem system{Eigen::MatrixXd(rows, columns), random.vector(static_cast<int>(rows), 1)};
  for (Eigen::Index i = 0; i < columns; ++i) {
    system.jacobian.col(i) = random.vector(static_cast<int>(rows), 1);
  }
  return system;
}

// Schur complement of the normal equations; the pseudo-inverse stands for what is not determined.
void check_schur(const LinearSystem& system, Eigen::Index count, const LinearSystem& prior) {
  const Eigen::Index kept = system.jacobian.cols() - count;
  const Eigen::MatrixXd h = system.jacobian.transpose() * system.jacobian;
  const Eigen::VectorXd g = system.jacobian.transpose() * system.residual;
  const Eigen::MatrixXd inverse =
      h.topLeftCorner(count, count).completeOrthogonalDecomposition().pseudoInverse();
  const Eigen::MatrixXd schur = h.bottomRightCorner(kept, kept) - h.bottomLeftCorner(kept, count) *
                                                                      inverse *
                                                                      h.topRightCorner(count, kept);
  const Eigen::VectorXd gradient =
      g.tail(kept) - h.bottomLeftCorner(kept, count) * inverse * g.head(count);
  const double scale = h.norm();
  CHECK((prior.jacobian.transpose() * prior.jacobian - schur).norm() < 1e-9 * scale);
  CHECK((prior.jacobian.transpose() * prior.residual - gradient).norm() < 1e-9 * scale);
  CHECK(prior.jacobian.rows() <= kept);
}

TEST_CASE("Marginalising leaves the Schur complement of a linear problem") {
  Random random(3);
  for (const auto& [rows, marginal, kept] :
       std::vector<std::array<int, 3>>{{40, 9, 12}, {200, 30, 36}, {20, 12, 12}, {9, 3, 12}}) {
    const LinearSystem system = random_system(random, rows, marginal + kept);
    check_schur(system, marginal, marginalize(system, marginal));
  }
}

TEST_CASE("Marginalising skips what the rows do not determine") {
  Random random(4);
  LinearSystem system = random_system(random, 60, 24);
  system.jacobian.col(2).setZero();
  system.jacobian.col(5) = system.jacobian.col(1) - 2 * system.jacobian.col(4);
  check_schur(system, 9, marginalize(system, 9));
  system.jacobian.col(20) = system.jacobian.col(12);  // nor need the rest be determined
  const LinearSystem prior = marginalize(system, 9);
  check_schur(system, 9, prior);
  CHECK(prior.jacobian.rows() == 14);
  const LinearSystem nothing =
      marginalize({Eigen::MatrixXd::Zero(6, 9), Eigen::VectorXd::Zero(6)}, 3);
  CHECK(nothing.jacobian.rows() == 0);
}

TEST_CASE("A linear prior's Jacobians are its derivatives") {
  const PoseManifold manifold;
  Random random(5);
  for (const double angle : {0.0, 0.3, 1.5}) {
    std::vector<Rigid3d> bases;
    std::vector<FactorBlock> blocks;
    for (int i = 0; i < 3; ++i) {
      bases.push_back(random.rigid(3, 3.1));
      blocks.push_back({(bases.back() * random.rigid(angle, angle)).params, &manifold});
    }
    const LinearSystem rows = random_system(random, 10, 18);
    const LinearPrior prior(bases, rows.jacobian, rows.residual);
    const FactorEvaluation at = evaluate(prior, blocks);
    REQUIRE(at.ok);
    if (angle == 0) CHECK((at.residual - rows.residual).norm() < 1e-12);
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      for (int k = 0; k < 6; ++k) {
        constexpr double kStep = 1e-6;
        std::vector<FactorBlock> forth = blocks;
        std::vector<FactorBlock> back = blocks;
        forth[b].value = blocks[b].moved(kStep * Vector6d::Unit(k));
        back[b].value = blocks[b].moved(-kStep * Vector6d::Unit(k));
        const Eigen::VectorXd numeric =
            (residual_of(prior, forth) - residual_of(prior, back)) / (2 * kStep);
        CHECK((at.jacobians[b].col(k) - numeric).norm() < 1e-7 * (1 + numeric.norm()));
      }
      CHECK(at.jacobians[b].col(6).norm() == 0);
    }
  }
  CHECK_THROWS_AS(LinearPrior({Rigid3d()}, Eigen::MatrixXd(3, 5), Eigen::VectorXd(3)),
                  std::logic_error);
  CHECK_THROWS_AS(
      LinearPrior({Rigid3d()}, Eigen::MatrixXd::Constant(3, 6, NAN), Eigen::VectorXd::Zero(3)),
      std::logic_error);
}

// A chain of poses, each measured from the three before it.
struct Chain {
  std::vector<Rigid3d> truth;
  std::vector<std::vector<GraphEdge>> edges;  // by the newer pose
};

Chain make_chain(int poses, double sigma, Random& random) {
  Chain chain;
  Rigid3d pose;
  for (int i = 0; i < poses; ++i) {
    chain.truth.push_back(pose);
    chain.edges.emplace_back();
    pose = Rigid3d(so3_exp({0.02, 0.1, -0.03}), {0.4, 0.05, 0.2}) * pose;
    for (int j = std::max(0, i - 3); j < i; ++j) {
      GraphEdge edge;
      edge.a = static_cast<std::uint32_t>(j);
      edge.b = static_cast<std::uint32_t>(i);
      Vector6d sigmas;
      sigmas << sigma, 2 * sigma, sigma, 0.5 * sigma, 0.3 * sigma, 0.5 * sigma;
      Vector6d noise;
      for (int k = 0; k < 6; ++k) noise[k] = sigmas[k] * random.gaussian();
      // The factor's error is that of measured^-1 * true, in frame b.
      edge.a_from_b = chain.truth[static_cast<std::size_t>(j)] *
                      inverse(chain.truth[static_cast<std::size_t>(i)]) * se3_exp(-noise);
      edge.information = sigmas.cwiseAbs2().cwiseInverse().asDiagonal();
      chain.edges.back().push_back(edge);
    }
  }
  return chain;
}

void feed(const Chain& chain, IncrementalSolver& solver) {
  for (std::uint32_t i = 0; i < chain.truth.size(); ++i) {
    GraphFrame frame;
    frame.fixed = i == 0;
    frame.cam_from_world = chain.truth[0];
    if (i > 0) {
      const GraphEdge& edge = chain.edges[i].back();
      frame.cam_from_world = inverse(edge.a_from_b) * solver.pose(edge.a);
    }
    solver.add_pose(frame);
    for (const GraphEdge& edge : chain.edges[i]) solver.add_edge(edge);
    solver.update();
  }
}

TEST_CASE("A window loses nothing of a nearly linear graph") {
  Random random(6);
  const Chain chain = make_chain(60, 1e-5, random);
  IncrementalOptions options;
  options.wildfire = 0;
  IncrementalSolver all(options);
  feed(chain, all);
  options.window = 6;
  IncrementalSolver window(options);
  feed(chain, window);
  const std::uint32_t last = 59;
  CHECK(se3_log(window.pose(last) * inverse(all.pose(last))).norm() < 1e-8);
  CHECK((window.covariance(last) - all.covariance(last)).norm() <
        1e-4 * all.covariance(last).norm());
  // ... and what it gave up no longer varies.
  const FactorGraph graph = window.graph();
  CHECK(graph.frames[40].fixed);
  CHECK_FALSE(graph.frames[55].fixed);
  CHECK(graph.priors.size() == 1);
  CHECK(graph.edges.size() < 30);
}

// Normalised error of a pose's estimate, chi2 of 6 degrees of freedom if its covariance is right.
double normalized_error(const IncrementalSolver& solver, std::uint32_t pose, const Rigid3d& truth) {
  const Vector6d error = se3_log(truth * inverse(solver.pose(pose)));
  return squared_mahalanobis(error, solver.covariance(pose));
}

// Mean over runs of a chi2 of 6 degrees of freedom, in its two-sided 95 % band (normal
// approximation, standard deviation sqrt(12 / runs)).
void check_band(double mean, int runs) {
  CHECK(mean > 6 - 1.96 * std::sqrt(12.0 / runs));
  CHECK(mean < 6 + 1.96 * std::sqrt(12.0 / runs));
}

TEST_CASE("A windowed pose graph is consistent") {
  constexpr int kRuns = 200;
  double sum = 0;
  for (int run = 0; run < kRuns; ++run) {
    Random random(static_cast<std::uint64_t>(run) + 100);
    const Chain chain = make_chain(30, 0.003, random);
    IncrementalOptions options;
    options.window = 6;
    IncrementalSolver solver(options);
    feed(chain, solver);
    sum += normalized_error(solver, 29, chain.truth[29]);
  }
  check_band(sum / kRuns, kRuns);
}

// A stereo camera that moves sideways over a rough plane.
double windowed_stereo_error(std::uint64_t seed, int poses, int window) {
  const Camera camera = TestCamera<RectifiedStereo>::camera();
  constexpr double kSigma = 0.7;
  Random random(seed);
  IncrementalOptions options;
  options.window = window;
  IncrementalSolver solver(options);
  solver.add_camera(camera);
  std::vector<Eigen::Vector3d> landmarks;
  for (int i = 0; i < 25 * (poses + 12); ++i) {
    landmarks.emplace_back(random.uniform(-2.0, 0.2 * poses + 2.0), random.uniform(-1.2, 1.2),
                           random.uniform(2.5, 3.5));
  }
  std::map<std::size_t, std::uint32_t> known;
  Rigid3d truth;
  for (int i = 0; i < poses; ++i) {
    truth = Rigid3d(so3_exp({0.02 * std::sin(0.3 * i), 0.03 * std::cos(0.2 * i), 0.01 * i}),
                    Eigen::Vector3d::Zero()) *
            Rigid3d(Eigen::Quaterniond::Identity(), {-0.2 * i, 0.05 * std::sin(0.4 * i), 0});
    GraphFrame frame{truth, 0, i == 0};
    if (i > 0) {
      Vector6d noise;
      for (int k = 0; k < 6; ++k) noise[k] = (k < 3 ? 0.005 : 0.002) * random.gaussian();
      frame.cam_from_world = se3_exp(noise) * truth;
    }
    const std::uint32_t pose = solver.add_pose(frame);
    for (std::size_t l = 0; l < landmarks.size(); ++l) {
      const auto seen = project_stereo(camera, truth * landmarks[l]);
      if (!seen || !in_image(camera, seen->head<2>())) continue;
      Eigen::Vector3d measured = *seen + random.gaussian3(kSigma);
      const auto in_cam = triangulate_stereo(camera, measured);
      if (!in_cam) continue;
      if (!known.contains(l)) {
        known[l] = solver.add_point(inverse(frame.cam_from_world) * *in_cam);
      }
      solver.add_observation({pose, known[l], measured, kSigma});
    }
    solver.update();
  }
  return normalized_error(solver, static_cast<std::uint32_t>(poses) - 1, truth);
}

TEST_CASE("A windowed stereo camera is consistent", "[slow]") {
  constexpr int kRuns = 150;
  double sum = 0;
  for (int run = 0; run < kRuns; ++run) {
    sum += windowed_stereo_error(static_cast<std::uint64_t>(run) + 1000, 24, 8);
  }
  check_band(sum / kRuns, kRuns);
}

}  // namespace
}  // namespace hybrid_slam
