// The bundle solver takes the steps that Ceres takes.
#include "backend/problem/bundle_solver.h"

#include <ceres/cost_function.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stop_token>
#include <string>

#include "backend/problem/solve_graph.h"
#include "cameras/geometry/se3.h"
#include "factors/make_reprojection_factor.h"
#include "test/support/random.h"

// After Ceres, whose logging has a CHECK of its own.
#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

struct RoomOptions {
  std::vector<Camera> cameras;  // frames have them in turn
  std::uint32_t frames = 12;
  std::uint32_t points = 150;
  double pose_noise = 0.01;
  double point_noise = 0.05;
  double wrong = 0.03;  // share of measurements that are far off
  double sigma = 0.5;   // of most measurements [px]; noise is 1 px at most
  bool edges = false;   // along the frames, and some that close loops, one of them wrong
  bool known_too = false;
  std::uint64_t seed = 5;
};

Camera pinhole() { return Calibrated<Pinhole>{{500, 510, 320, 240}, 640, 480}; }
Camera stereo() { return Calibrated<RectifiedStereo>{{500, 500, 320, 240, 0.12}, 640, 480}; }
Camera fisheye() {
  return Calibrated<KannalaBrandt>{{240, 240, 400, 400, 0.02, -0.008, 0.002, -0.0005}, 800, 800};
}
Camera radial() { return Calibrated<Radial>{{500, 320, 240, -0.05, 0.01}, 640, 480}; }
Camera bal() { return Calibrated<Bal>{{500, -0.05, 0.01}, 640, 480}; }

Eigen::Vector3d measure(const FactorGraph& graph, const GraphObservation& seen, Random& random) {
  const GraphFrame& frame = graph.frames[seen.frame];
  const Camera& camera = graph.cameras[frame.camera].camera;
  const Eigen::Vector3d in_cam = frame.cam_from_world * graph.points[seen.point].in_world;
  Eigen::Vector3d measurement(0, 0, 0);
  measurement.head<2>() = project(camera, in_cam).value();
  if (const auto triple = project_stereo(camera, in_cam)) measurement = *triple;
  measurement += random.gaussian3(std::min(seen.sigma, 1.0));
  if (seen.point % 5 == 0) measurement[2] = std::nan("");  // no right match
  return measurement;
}

void add_edges(FactorGraph& graph, Random& random) {
  const auto count = static_cast<std::uint32_t>(graph.frames.size());
  const auto add = [&](std::uint32_t a, std::uint32_t b, double noise, bool loop) {
    const Rigid3d a_from_b =
        graph.frames[a].cam_from_world * inverse(graph.frames[b].cam_from_world);
    Matrix6d root = 300 * Matrix6d::Identity();  // as sure as all that a frame sees
    for (double& value : root.reshaped()) value += random.uniform(-60, 60);
    graph.edges.push_back(
        {a, b, random.rigid(noise, noise) * a_from_b, root * root.transpose(), loop});
  };
  for (std::uint32_t i = 1; i < count; ++i) add(i - 1, i, 0.003, false);
  add(0, count - 1, 0.003, true);
  add(count - 2, 2, 2, true);
}

// Frames before a cloud of points, each of which some frames see in any order. Two are known, which
// holds the scale of cameras without a baseline.
FactorGraph make_room(const RoomOptions& options) {
  Random random(options.seed);
  FactorGraph graph;
  for (const Camera& camera : options.cameras) graph.cameras.push_back({camera, 0});
  for (std::uint32_t i = 0; i < options.frames; ++i) {
    const auto camera = static_cast<std::uint32_t>(i % options.cameras.size());
    Rigid3d pose = random.rigid(0.2, 0.1) * Rigid3d({1, 0, 0, 0}, {0.1 * (i % 5) - 0.2, 0, 0});
    if (std::holds_alternative<Calibrated<Bal>>(options.cameras[camera])) {
      pose = Rigid3d({0, 1, 0, 0}, {0, 0, 0}) * pose;  // it looks backward
    }
    graph.frames.push_back({pose, camera, i < 2 || (options.known_too && i % 4 == 0)});
  }
  for (std::uint32_t p = 0; p < options.points; ++p) {
    graph.points.push_back({{random.uniform(-2, 2), random.uniform(-1, 1), random.uniform(3, 6)},
                            options.known_too && p % 6 == 0});
    for (std::uint32_t i = 0; i < options.frames; ++i) {
      if (random.uniform() > 0.4) continue;
      const int times = random.uniform() < 0.05 ? 2 : 1;
      for (int k = 0; k < times; ++k)
        graph.observations.push_back({i, p, Eigen::Vector3d::Zero(), options.sigma * (1 + k)});
    }
  }
  for (std::size_t i = graph.observations.size(); i > 1; --i) {
    std::swap(graph.observations[i - 1], graph.observations[random.below(i)]);
  }
  for (GraphObservation& seen : graph.observations) {
    seen.measurement = measure(graph, seen, random);
    if (random.uniform() < options.wrong) seen.measurement[0] += 30;
  }
  if (options.edges) add_edges(graph, random);
  for (GraphFrame& frame : graph.frames) {
    const Rigid3d noise = random.rigid(options.pose_noise, options.pose_noise);
    if (!frame.fixed) frame.cam_from_world = noise * frame.cam_from_world;
  }
  for (GraphPoint& point : graph.points) {
    if (!point.fixed) point.in_world += random.gaussian3(options.point_noise);
  }
  return graph;
}

struct Run {
  FactorGraph graph;
  GraphSummary summary;
  std::vector<IterationReport> reports;
};

Run run(const FactorGraph& graph, ProblemOptions options, LinearSolver solver) {
  Run made{graph, {}, {}};
  options.linear_solver = solver;
  made.summary = solve_graph(made.graph, options, {}, [&](const IterationReport& report) {
    made.reports.push_back(report);
  });
  return made;
}

double distance(const FactorGraph& a, const FactorGraph& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    most = std::max(most, (a.frames[i].cam_from_world.params - b.frames[i].cam_from_world.params)
                              .lpNorm<Eigen::Infinity>());
  }
  for (std::size_t i = 0; i < a.points.size(); ++i) {
    most = std::max(most, (a.points[i].in_world - b.points[i].in_world).lpNorm<Eigen::Infinity>());
  }
  return most;
}

// Costs and lengths of all steps, how it ends, and the estimate.
void check_equal(const Run& ours, const Run& ceres) {
  REQUIRE(ours.reports.size() == ceres.reports.size());
  for (std::size_t i = 0; i < ours.reports.size(); ++i) {
    CAPTURE(i);
    CHECK(ours.reports[i].round == ceres.reports[i].round);
    CHECK(ours.reports[i].iteration == ceres.reports[i].iteration);
    CHECK(ours.reports[i].cost == Approx(ceres.reports[i].cost).epsilon(1e-9));
    CHECK(ours.reports[i].step_norm == Approx(ceres.reports[i].step_norm).epsilon(1e-6));
  }
  CHECK(ours.summary.end == ceres.summary.end);
  CHECK(ours.summary.text.substr(0, 30) == ceres.summary.text.substr(0, 30));
  CHECK(ours.summary.iterations == ceres.summary.iterations);
  // With what was set aside: nothing holds it, and its residuals are hundreds of times as large.
  CHECK(ours.summary.final_cost == Approx(ceres.summary.final_cost).epsilon(1e-7));
  CHECK(ours.summary.kept_final_cost == Approx(ceres.summary.kept_final_cost).epsilon(1e-9));
  CHECK(ours.summary.outliers == ceres.summary.outliers);
  CHECK(distance(ours.graph, ceres.graph) < 1e-7);
}

ProblemOptions rounds_of(Loss loss, Loss loop_loss = Loss::kNone) {
  ProblemOptions options;
  options.rounds = {{8, loss, 1e-4}, {12, Loss::kNone, 1e-8}};
  options.loop_loss = loop_loss;
  return options;
}

TEST_CASE("bundle solver: costs of all iterations and the result are those of Ceres") {
  RoomOptions options;
  options.cameras = GENERATE(std::vector{pinhole()}, std::vector{stereo()}, std::vector{fisheye()},
                             std::vector{radial()}, std::vector{bal()},
                             std::vector{stereo(), fisheye(), radial(), pinhole(), bal()});
  const Loss loss = GENERATE(Loss::kNone, Loss::kHuber, Loss::kCauchy);
  options.edges = loss != Loss::kNone;
  options.known_too = GENERATE(true, false);
  CAPTURE(model_name(options.cameras[0]), options.cameras.size(), static_cast<int>(loss),
          options.known_too);
  const FactorGraph graph = make_room(options);
  REQUIRE(is_plain_bundle(graph));
  const ProblemOptions rounds = rounds_of(loss, loss);
  const Run ours = run(graph, rounds, LinearSolver::kAuto);
  CHECK(ours.summary.iterations >= 4);
  check_equal(ours, run(graph, rounds, LinearSolver::kSparse));
}

TEST_CASE(
    "bundle solver: an observation has the same chi2, bit by bit, as by the factor for Ceres") {
  RoomOptions options;
  options.cameras = {stereo(), fisheye(), radial(), pinhole(), bal()};
  const FactorGraph graph = make_room(options);
  for (const GraphObservation& seen : graph.observations) {
    const GraphFrame& frame = graph.frames[seen.frame];
    const auto factor =
        make_reprojection_factor(graph.cameras[frame.camera].camera, seen.measurement, seen.sigma);
    const double* blocks[] = {frame.cam_from_world.params.data(),
                              graph.points[seen.point].in_world.data()};
    double residual[3] = {};
    REQUIRE(factor->Evaluate(blocks, residual, nullptr));
    double sum = 0;
    for (const double value : residual) sum += value * value;
    CHECK(chi2(graph, seen) == sum);
    CHECK(residual_count(graph, seen) == factor->num_residuals());
  }
}

TEST_CASE("bundle solver: directions that measurements hardly determine are damped as by Ceres") {
  RoomOptions options;
  options.cameras = {stereo(), fisheye()};
  options.sigma = GENERATE(5e4, 2e5, 1e6);  // an information of 1e-5, 4e-7 and 2e-8
  CAPTURE(options.sigma);
  const FactorGraph graph = make_room(options);
  ProblemOptions rounds;
  rounds.rounds = {{10, Loss::kNone, 1e-9}};
  const Run ours = run(graph, rounds, LinearSolver::kAuto);
  CHECK(ours.summary.iterations >= 3);
  check_equal(ours, run(graph, rounds, LinearSolver::kSparse));
}

TEST_CASE("bundle solver: a step behind a camera is refused and a shorter one taken, as by Ceres") {
  RoomOptions options;
  options.cameras = {stereo(), pinhole()};
  options.pose_noise = 0.3;
  options.point_noise = 1.2;
  ProblemOptions rounds;
  rounds.rounds = {{25, Loss::kNone, 1e-9}};
  int refused = 0;
  for (options.seed = 1; options.seed <= 12; ++options.seed) {
    CAPTURE(options.seed);
    const FactorGraph graph = make_room(options);
    const Run ours = run(graph, rounds, LinearSolver::kAuto);
    const Run ceres = run(graph, rounds, LinearSolver::kSparse);
    REQUIRE(ours.reports.size() == ceres.reports.size());
    for (std::size_t i = 0; i < ours.reports.size(); ++i) {
      CAPTURE(i);
      CHECK(ours.reports[i].cost == Approx(ceres.reports[i].cost).epsilon(1e-6));
      refused += ours.reports[i].cost == std::numeric_limits<double>::max() ? 1 : 0;
    }
    CHECK(ours.summary.end == ceres.summary.end);
  }
  CHECK(refused > 3);
}

TEST_CASE("bundle solver: observations set aside, points seen once, frames without a term") {
  RoomOptions options;
  options.cameras = {stereo(), fisheye()};
  FactorGraph graph = make_room(options);
  std::erase_if(graph.observations, [](const GraphObservation& seen) {
    return seen.frame == 3 || (seen.point < 20 && seen.frame % 4 != 2) || seen.point == 30;
  });
  const FactorGraph before = graph;
  const Run ours = run(graph, rounds_of(Loss::kHuber), LinearSolver::kAuto);
  check_equal(ours, run(graph, rounds_of(Loss::kHuber), LinearSolver::kSparse));
  CHECK(ours.graph.frames[3].cam_from_world.params == before.frames[3].cam_from_world.params);
  CHECK(ours.graph.points[30].in_world == before.points[30].in_world);
}

TEST_CASE("bundle solver: points alone, poses alone, and nothing that varies") {
  RoomOptions options;
  options.cameras = {stereo()};
  FactorGraph graph = make_room(options);
  for (GraphFrame& frame : graph.frames) frame.fixed = true;
  const ProblemOptions rounds = rounds_of(Loss::kHuber);
  check_equal(run(graph, rounds, LinearSolver::kAuto), run(graph, rounds, LinearSolver::kSparse));

  graph = make_room(options);
  for (GraphPoint& point : graph.points) point.fixed = true;
  check_equal(run(graph, rounds, LinearSolver::kAuto), run(graph, rounds, LinearSolver::kDense));

  for (GraphFrame& frame : graph.frames) frame.fixed = true;
  const Run nothing = run(graph, rounds, LinearSolver::kAuto);
  CHECK(nothing.summary.end == SolveEnd::kEmpty);
  CHECK(nothing.summary.text == kNothingVaries);
}

TEST_CASE("bundle solver: the same bytes each time, whatever the number of threads") {
  RoomOptions options;
  options.cameras = {stereo(), fisheye()};
  options.frames = 80;
  options.points = 400;
  const FactorGraph graph = make_room(options);
  ProblemOptions rounds = rounds_of(Loss::kHuber);
  const Run first = run(graph, rounds, LinearSolver::kAuto);
  rounds.threads = 2;
  const Run second = run(graph, rounds, LinearSolver::kAuto);
  CHECK(distance(first.graph, second.graph) == 0);
  CHECK(first.summary.final_cost == second.summary.final_cost);
}

TEST_CASE("bundle solver: ends on request, by the limit of iterations and by the clock") {
  RoomOptions options;
  options.cameras = {stereo()};
  const FactorGraph graph = make_room(options);
  ProblemOptions rounds;
  rounds.rounds = {{3, Loss::kNone, 0}};
  CHECK(run(graph, rounds, LinearSolver::kAuto).summary.end == SolveEnd::kIterationLimit);
  check_equal(run(graph, rounds, LinearSolver::kAuto), run(graph, rounds, LinearSolver::kSparse));

  rounds.rounds = {{50, Loss::kNone, 0}};
  std::stop_source stop;
  FactorGraph solved = graph;
  const GraphSummary stopped =
      solve_graph(solved, rounds, stop.get_token(), [&](const IterationReport& report) {
        if (report.iteration == 2) stop.request_stop();
      });
  CHECK(stopped.end == SolveEnd::kStopped);
  CHECK(stopped.iterations == 2);
  CHECK(stopped.final_cost < stopped.initial_cost);

  rounds.max_seconds = 1e-9;
  const Run late = run(graph, rounds, LinearSolver::kAuto);
  CHECK(late.summary.end == SolveEnd::kTimeLimit);
  CHECK(late.summary.iterations == 0);
}

TEST_CASE("bundle solver: what it has no equations for goes to Ceres") {
  RoomOptions options;
  options.cameras = {pinhole()};
  FactorGraph graph = make_room(options);
  REQUIRE(is_plain_bundle(graph));
  graph.cameras[0].refined = 1;
  CHECK_FALSE(is_plain_bundle(graph));
  graph.cameras[0].refined = 0;
  graph.blocks.push_back({Eigen::VectorXd::Zero(3)});
  CHECK_FALSE(is_plain_bundle(graph));
  graph.blocks.clear();
  graph.priors.emplace_back();
  CHECK_FALSE(is_plain_bundle(graph));
  graph.priors.clear();
  graph.observations.clear();
  CHECK_FALSE(is_plain_bundle(graph));
}

}  // namespace
}  // namespace hybrid_slam
