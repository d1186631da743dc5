#include <algorithm>
#include <cmath>
#include <sstream>

#include <catch2/catch.hpp>

#include "apps/io/graphs/bal.h"
#include "test/apps/graphs/graph_checks.h"
#include "test/apps/graphs/optimizer_run.h"
#include "test/support/random.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// Cameras in a row before a wall, exactly measured.
FactorGraph exact_problem(std::uint32_t frames = 6) {
  Random random(31);
  FactorGraph graph;
  for (int i = 0; i < 80; ++i) {
    graph.points.push_back(
        {{random.uniform(-2, 2 + 0.5 * frames), random.uniform(-2, 2), random.uniform(-7, -5)}});
  }
  for (std::uint32_t i = 0; i < frames; ++i) {
    GraphFrame frame;
    frame.cam_from_world = random.rigid(0.1, 0.1);
    frame.cam_from_world.translation()[0] -= 0.5 * i;
    frame.camera = i;
    graph.frames.push_back(frame);
    graph.cameras.push_back({Calibrated<Bal>{{500, -0.05, 0.01}}});
    for (std::uint32_t k = 0; k < graph.points.size(); ++k) {
      GraphObservation observation;
      observation.frame = i;
      observation.point = k;
      const auto pixel =
          project(graph.cameras[i].camera, frame.cam_from_world * graph.points[k].in_world);
      if (pixel->cwiseAbs().maxCoeff() > 250) continue;
      observation.measurement.head<2>() = *pixel;
      graph.observations.push_back(observation);
    }
  }
  return graph;
}

// The same with an estimate that is off; frame 0 stays.
FactorGraph moved(FactorGraph graph) {
  Random random(32);
  for (std::size_t i = 1; i < graph.frames.size(); ++i) {
    graph.frames[i].cam_from_world = random.rigid(0.02, 0.005) * graph.frames[i].cam_from_world;
  }
  for (GraphPoint& point : graph.points) point.in_world += random.gaussian3(0.03);
  return graph;
}

double final_cost(const fs::path& input, const std::vector<std::string>& more = {}) {
  const TempFolder folder;
  std::vector<std::string> arguments{input.string(), "--quiet"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const Outcome outcome = run_optimizer(folder, arguments);
  CAPTURE(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(outcome.err.empty());  // nor a word from the solver's library
  return report_of(folder)["final_cost"];
}

}  // namespace

TEST_CASE("map_optimizer: finds the optimum, writes it and reports on it") {
  const TempFolder folder;
  const FactorGraph start = moved(exact_problem());
  write_bal(folder.path() / "in.txt", start);
  const Outcome outcome = run_optimizer(folder, {"in.txt"});
  CAPTURE(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK_THAT(outcome.err, Catch::Contains("iteration   1  cost "));
  const Json report = report_of(folder);
  CHECK(report["format"] == "bal");
  CHECK(report["initial_cost"] == Approx(reference_cost(start)).epsilon(1e-12));
  CHECK(report["final_cost"] < 1e-6);
  CHECK(report["counts"]["frames"] == 6);
  CHECK(report["counts"]["observations"] == start.observations.size());
  CHECK(report["iterations"] > 1);
  CHECK(report["termination"]["end"] == "converged");
  CHECK(report["outliers"].empty());
  CHECK(report["unprojectable"].empty());
  const Json& rmse = report["reprojection_rmse_px"]["bal"];
  const double count = static_cast<double>(start.observations.size());
  CHECK(rmse["initial"] == Approx(std::sqrt(2 * reference_cost(start) / count)));
  CHECK(rmse["final"] < 1e-4);
  for (const char* const phase : {"read", "build", "solve", "write", "total"}) {
    CHECK(report["seconds"][phase] >= 0);
    CHECK(report["cpu_seconds"][phase] >= 0);
  }
  CHECK(report["peak_memory_mb"] > 1);
  CHECK(report["blas"].is_string());
  const GraphFile written = read_graph(folder.path() / "out/optimized.txt");
  CHECK(reference_cost(written.graph) < 1e-6);
  CHECK_FALSE(fs::exists(folder.path() / "out/optimized.tum"));
}

TEST_CASE("map_optimizer: the result, read again, has the cost that was reported") {
  const TempFolder folder;
  FactorGraph start = moved(exact_problem());
  Random random(33);
  for (GraphObservation& o : start.observations) o.measurement += random.gaussian3(0.5);
  write_bal(folder.path() / "in.txt", start);
  REQUIRE(run_optimizer(folder, {"in.txt", "--quiet"}).code == 0);
  const double cost = report_of(folder)["final_cost"];
  CHECK(cost > 1);
  CHECK(cost < 0.5 * reference_cost(start));
  REQUIRE(run_optimizer(folder, {"out/optimized.txt", "--quiet", "--out", "again"}).code == 0);
  CHECK(std::abs(report_of(folder, "again")["initial_cost"].get<double>() - cost) < 1e-12 * cost);
}

TEST_CASE(
    "map_optimizer: under a robust loss the report names an outlier; Cauchy's lets go of it") {
  const TempFolder folder;
  FactorGraph start = moved(exact_problem());
  const std::size_t bad = start.observations.size() / 2;
  start.observations[bad].measurement[0] += 40;
  write_bal(folder.path() / "in.txt", start);
  const char* const robust = GENERATE("huber", "cauchy");
  REQUIRE(run_optimizer(folder, {"in.txt", "--quiet", "--robust", robust}).code == 0);
  const Json report = report_of(folder);
  CHECK(report["robust"] == robust);
  const Json& outliers = report["outliers"];
  const auto named = std::find_if(outliers.begin(), outliers.end(), [&](const Json& outlier) {
    return outlier["frame"] == std::to_string(start.observations[bad].frame) &&
           outlier["point"] == start.observations[bad].point;
  });
  REQUIRE(named != outliers.end());
  if (robust == std::string("cauchy")) {  // huber only weakens the pull
    CHECK(outliers.size() == 1);
    CHECK((*named)["error_px"] > 35);
    CHECK(report["final_cost"] == Approx(0.5 * 40 * 40).epsilon(0.1));  // without the loss
  }
}

TEST_CASE("map_optimizer: what may vary") {
  const TempFolder folder;
  FactorGraph start = moved(exact_problem(24));
  for (GraphCamera& camera : start.cameras) {
    std::get<Calibrated<Bal>>(camera.camera).params[0] = 505;
  }
  write_bal(folder.path() / "in.txt", start);
  const auto run = [&](const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"in.txt", "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    REQUIRE(run_optimizer(folder, arguments).code == 0);
    return read_graph(folder.path() / "out/optimized.txt").graph;
  };
  const auto focal = [](const FactorGraph& graph) { return focal_length(graph.cameras[3].camera); };
  const auto moved_frames = [&](const FactorGraph& graph) {
    std::vector<std::size_t> frames;
    for (std::size_t i = 0; i < graph.frames.size(); ++i) {
      if ((graph.frames[i].cam_from_world.params - start.frames[i].cam_from_world.params).norm() >
          1e-6) {
        frames.push_back(i);
      }
    }
    return frames;
  };
  const FactorGraph refined = run({});
  CHECK(focal(refined) == Approx(500).epsilon(1e-3));
  CHECK(moved_frames(refined).size() == 23);  // all but the first
  CHECK(focal(run({"--fix-intrinsics"})) == 505);
  const FactorGraph local = run({"--problem", "local"});
  CHECK(focal(local) == 505);
  const std::vector<std::size_t> window = moved_frames(local);
  CHECK(window.size() > 2);
  CHECK(window.size() < 23);
  CHECK(window.front() > 5);
  CHECK(window.back() == 23);
}

TEST_CASE("map_optimizer: a pose graph from a start that is far off") {
  const TempFolder folder;
  Random random(34);
  std::vector<Rigid3d> truth;  // world_from_body on a ring
  for (int i = 0; i < 20; ++i) {
    const double angle = 0.3 * i;
    truth.push_back({Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())),
                     {std::cos(angle), std::sin(angle), 0}});
  }
  std::ostringstream text;
  text.precision(17);
  const auto add_pose = [&](const Rigid3d& pose) {
    for (const int i : {4, 5, 6, 0, 1, 2, 3}) text << ' ' << pose.params[i];
  };
  for (std::size_t i = 0; i < 20; ++i) {
    text << "VERTEX_SE3:QUAT " << i;
    add_pose(i == 0 ? truth[0] : random.rigid(3, 3));
    text << '\n';
  }
  for (std::size_t i = 0; i < 20; ++i) {
    for (const std::size_t j : {i + 1, i + 5}) {
      if (j >= 20) continue;
      text << "EDGE_SE3:QUAT " << i << ' ' << j;
      add_pose(inverse(truth[i]) * truth[j]);
      text << " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";
    }
  }
  write_text(folder.path() / "ring.g2o", text.str());
  REQUIRE(run_optimizer(folder, {"ring.g2o", "--quiet", "--problem", "loop"}).code == 0);
  const Json report = report_of(folder);
  CHECK(report["start"] != "given");
  CHECK(report["final_cost"] < 1e-9);
  const GraphFile result = read_graph(folder.path() / "out/optimized.g2o");
  for (std::size_t i = 0; i < 20; ++i) {
    CHECK((inverse(result.graph.frames[i].cam_from_world).translation() - truth[i].translation())
              .norm() < 1e-4);
  }
}

TEST_CASE("map_optimizer: a stereo stream, with its trajectory and its truth") {
  const auto folder = shared_graphs();
  if (!folder) return;
  const TempFolder out;
  const std::string stream = (*folder / "stereo_seq/survey-150-stereo.seq").string();
  REQUIRE(run_optimizer(out, {stream, "--quiet"}).code == 0);
  const Json report = report_of(out);
  CHECK(report["final_cost"] == Approx(29014.602).epsilon(1e-7));
  CHECK(report["ate"]["position_m"]["rmse"] == Approx(0.00556).epsilon(2e-3));
  CHECK(read_text(out.path() / "out/optimized.tum").substr(0, 12) == "0.000000000 ");
  CHECK(fs::exists(out.path() / "out/optimized.seq"));
}

TEST_CASE("map_optimizer: a bundle adjustment problem becomes a map") {
  const TempFolder folder;
  FactorGraph exact = exact_problem();
  exact.points.push_back({{0, 0, -6}});  // which one frame sees: too few
  GraphObservation lone;
  lone.point = static_cast<std::uint32_t>(exact.points.size()) - 1;
  lone.measurement.head<2>() = *project(
      exact.cameras[0].camera, exact.frames[0].cam_from_world * exact.points[lone.point].in_world);
  exact.observations.push_back(lone);
  std::vector<std::size_t> seen(exact.points.size());
  for (const GraphObservation& o : exact.observations) ++seen[o.point];
  const auto alone = static_cast<std::size_t>(std::count(seen.begin(), seen.end(), 1U));
  write_bal(folder.path() / "in.txt", moved(exact));
  REQUIRE(run_optimizer(folder, {"in.txt", "--quiet", "--format", "map"}).code == 0);
  REQUIRE(run_optimizer(folder, {"out/optimized.hslam", "--quiet", "--out", "map"}).code == 0);
  const Json report = report_of(folder, "map");
  CHECK(report["counts"]["frames"] == 6);
  CHECK(report["counts"]["points"] == exact.points.size() - alone);
  CHECK(report["counts"]["observations"] == exact.observations.size() - alone);
  CHECK(report["initial_cost"] < 1e-5);  // single precision
}

TEST_CASE("map_optimizer: bad usage ends with code 2") {
  const TempFolder folder;
  check_refused(run_optimizer(folder, {}), 2, "INPUT is required");
  check_refused(run_optimizer(folder, {"x", "--problem", "some"}), 2, "--problem: ");
  check_refused(run_optimizer(folder, {"x", "--robust", "l1"}), 2, "--robust: ");
  check_refused(run_optimizer(folder, {"x", "--format", "png"}), 2, "--format: ");
  check_refused(run_optimizer(folder, {"x", "--threads", "0"}), 2, "--threads: ");
  check_refused(run_optimizer(folder, {"x", "--iterations", "-1"}), 2, "--iterations: ");
  check_refused(run_optimizer(folder, {"x", "--out", ""}), 2, "--out");
  check_refused(run_optimizer(folder, {"x", "--fast"}), 2, "--fast");
}

TEST_CASE("map_optimizer: bad input ends with code 3 and one line, before anything is written") {
  const TempFolder folder;
  check_refused(run_optimizer(folder, {"nowhere"}), 3, "nowhere: no such file");
  write_text(folder.path() / "odd.g2o", "VERTEX_SE5 0 0 0 0\n");
  check_refused(run_optimizer(folder, {"odd.g2o"}), 3, "odd.g2o:1: \"VERTEX_SE5\" is not");
  write_text(folder.path() / "line.txt", "some text\n");
  check_refused(run_optimizer(folder, {"line.txt"}), 3, "line.txt:1: \"some\" begins no kind");
  write_bal(folder.path() / "in.txt", exact_problem());
  check_refused(run_optimizer(folder, {"in.txt", "--format", "g2o"}), 3,
                "in.txt: cannot be written as g2o, only as bal or map");
  CHECK_FALSE(fs::exists(folder.path() / "out"));
  check_refused(run_optimizer(folder, {"in.txt", "--quiet", "--out", "in.txt"}), 3, "in.txt: ");
  const Outcome no_edges = run_optimizer(folder, {"in.txt", "--quiet", "--problem", "loop"});
  check_refused(no_edges, 3, "in.txt: holds no edges");
}

TEST_CASE("map_optimizer: nothing to optimise ends with code 4") {
  const TempFolder folder;
  write_text(folder.path() / "one.g2o", "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n");
  check_refused(run_optimizer(folder, {"one.g2o", "--quiet"}), 4, "nothing to optimise");
}

TEST_CASE("map_optimizer: published problems reach what all solvers agree on") {
  const auto folder = shared_graphs();
  if (!folder) return;
  CHECK(final_cost(*folder / "bal/trafalgar-21-11315-pre.txt") == Approx(30378.64).epsilon(3e-7));
  CHECK(final_cost(*folder / "bal/survey-150-pre.txt") == Approx(8782.227).epsilon(1e-7));
  // 31 of its observations start behind their camera, and count.
  CHECK(final_cost(*folder / "bal/problem-49-7776-pre.txt") <= 13344.3);
}

}  // namespace hybrid_slam
