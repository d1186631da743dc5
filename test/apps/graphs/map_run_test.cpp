#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "backend/map/map_file.h"
#include "backend/problem/full_bundle.h"
#include "backend/problem/local_bundle.h"
#include "backend/problem/map_graph.h"
#include "backend/problem/solve_bundle.h"
#include "backend/problem/solve_graph.h"
#include "test/apps/graphs/graph_checks.h"
#include "test/apps/graphs/optimizer_run.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

const MapFileInfo kInfo{"a program 1.2", "features: 2000\n"};

// Stereo pair and fisheye, an estimate that is off, and wrong matches.
FilledMap make_map(double outlier_rate = 0.02) {
  SyntheticSceneOptions options;
  options.times = 12;
  options.landmarks = 400;
  options.fisheye = true;
  options.outlier_rate = outlier_rate;
  FillOptions noise;
  noise.rotation_noise = 0.01;
  noise.translation_noise = 0.02;
  noise.point_noise = 0.05;
  return fill_map(make_synthetic_scene(options), noise);
}

// Of every observation.
double whole_cost(const MapSnapshot& map) {
  ProblemConfig config;
  config.variable_poses = map.keyframe_ids();
  config.variable_landmarks = map.landmark_ids();
  return cost(make_graph(map, config).graph);
}

Json run_on_map(const TempFolder& folder, std::vector<std::string> arguments,
                const std::string& out = "out") {
  arguments.insert(arguments.end(), {"--quiet", "--out", out});
  const Outcome outcome = run_optimizer(folder, arguments);
  CAPTURE(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(outcome.err.empty());
  return report_of(folder, out);
}

bool moved(const MapSnapshot& a, const MapSnapshot& b, KeyframeId id) {
  return a.at(id).cam_from_world.params != b.at(id).cam_from_world.params;
}

bool is_observation(const MapSnapshot& map, const Json& named) {
  const KeyframeId keyframe(
      static_cast<std::uint32_t>(std::stoul(named["frame"].get<std::string>())));
  const Landmark& landmark = map.at(LandmarkId(named["point"].get<std::uint32_t>()));
  return std::any_of(landmark.observations.begin(), landmark.observations.end(),
                     [&](const Observation& o) { return o.keyframe == keyframe; });
}

}  // namespace

TEST_CASE("a map that was saved and loaded is optimised to the same cost") {
  const TempFolder folder;
  FilledMap filled = make_map();
  save_map(folder.path() / "map.hslam", filled.map.view(), kInfo);
  const LoadedMap loaded = load_map(folder.path() / "map.hslam");
  const auto optimized_cost = [](const MapSnapshot& map, const ProblemConfig& config) {
    const BundleSummary summary = solve_bundle(map, config).summary;
    CHECK(summary.final_cost < 0.5 * summary.initial_cost);
    CHECK(summary.outliers > 0);
    return summary.final_cost;
  };
  const MapSnapshot& map = filled.map.view();
  const MapSnapshot& again = loaded.map.view();
  const double full = optimized_cost(map, make_full_bundle(map, {}));
  CHECK(std::abs(optimized_cost(again, make_full_bundle(again, {})) - full) <= 1e-12 * full);
  const KeyframeId newest = map.keyframe_ids().back();
  const double local = optimized_cost(map, make_local_bundle(map, newest, {}));
  CHECK(std::abs(optimized_cost(again, make_local_bundle(again, newest, {})) - local) <=
        1e-12 * local);
}

TEST_CASE("map_optimizer: a map file, full bundle adjustment") {
  const TempFolder folder;
  FilledMap filled = make_map();
  const MapSnapshot& before = filled.map.view();
  save_map(folder.path() / "map.hslam", before, kInfo);
  const Json report = run_on_map(folder, {"map.hslam"});
  CHECK(report["format"] == "map");
  CHECK(report["robust"] == Json({"huber", "none"}));
  CHECK(report["initial_cost"].get<double>() == Approx(whole_cost(before)).epsilon(1e-12));
  CHECK(report["counts"]["fixed_frames"] == 1);
  CHECK(report["reprojection_rmse_px"].size() == 2);

  const LoadedMap result = load_map(folder.path() / "out/optimized.hslam");
  const MapSnapshot& after = result.map.view();
  CHECK(report["final_cost"].get<double>() == Approx(whole_cost(after)).epsilon(1e-12));
  CHECK(result.map.check_consistency() == std::vector<std::string>{});
  CHECK(result.info.program == kInfo.program);
  CHECK(result.info.options == kInfo.options);
  CHECK(after.keyframe_ids() == before.keyframe_ids());
  CHECK(after.landmark_ids() == before.landmark_ids());
  CHECK_FALSE(moved(before, after, before.origin()));
  CHECK(moved(before, after, before.keyframe_ids().back()));

  // What the backend finds, in memory.
  MapGraph made = make_graph(before, make_full_bundle(before, {}));
  ProblemOptions options = make_full_bundle(before, {}).options;
  options.rounds.back().iterations = 100;
  const GraphSummary summary = solve_graph(made.graph, options);
  CHECK(report["final_cost"].get<double>() == Approx(summary.final_cost).epsilon(1e-12));
  CHECK(report["outliers"].size() == summary.outliers.size());
  CHECK(summary.outliers.size() > 20);
  for (const Json& outlier : report["outliers"]) CHECK(is_observation(before, outlier));

  const Json again = run_on_map(folder, {"out/optimized.hslam"}, "again");
  CHECK(again["initial_cost"].get<double>() ==
        Approx(report["final_cost"].get<double>()).epsilon(1e-12));
}

TEST_CASE("map_optimizer: a map file's other problems and formats") {
  const TempFolder folder;
  FilledMap filled = make_map();
  const MapSnapshot& before = filled.map.view();
  save_map(folder.path() / "map.hslam", before, kInfo);

  const KeyframeId around = before.keyframe_ids()[4];
  const ProblemConfig window = make_local_bundle(before, around, {});
  run_on_map(folder, {"map.hslam", "--problem", "local", "--keyframe", "4"});
  const LoadedMap local = load_map(folder.path() / "out/optimized.hslam");
  std::vector<KeyframeId> varied;
  for (const KeyframeId id : before.keyframe_ids()) {
    if (moved(before, local.map.view(), id)) varied.push_back(id);
  }
  CHECK(varied == window.variable_poses);

  const Json loop = run_on_map(folder, {"map.hslam", "--problem", "loop"});
  CHECK(loop["final_cost"].get<double>() ==
        Approx(loop["initial_cost"].get<double>()).epsilon(1e-9));

  const Json plain = run_on_map(folder, {"map.hslam", "--robust", "none", "--format", "ply"});
  CHECK(plain["robust"] == "none");
  CHECK(plain["final_cost"] < plain["initial_cost"]);
  CHECK(read_text(folder.path() / "out/optimized.ply").starts_with("ply\n"));

  save_map(folder.path() / "clean.hslam", make_map(0).map.view(), kInfo);
  const Json batch = run_on_map(folder, {"clean.hslam", "--robust", "none"});
  const Json stream = run_on_map(folder, {"clean.hslam", "--problem", "incremental"});
  CHECK(stream["updates"]["count"] == before.keyframe_count());
  CHECK(stream["final_cost"].get<double>() ==
        Approx(batch["final_cost"].get<double>()).epsilon(1e-3));
}

TEST_CASE("map_optimizer: what a map file is refused for") {
  const TempFolder folder;
  FilledMap filled = make_map();
  save_map(folder.path() / "map.hslam", filled.map.view(), kInfo);
  check_refused(
      run_optimizer(folder, {"map.hslam", "--quiet", "--problem", "local", "--keyframe", "77777"}),
      3, "map.hslam: has no frame \"77777\"");
  check_refused(run_optimizer(folder, {"map.hslam", "--quiet", "--keyframe", "1"}), 2,
                "--keyframe");
  check_refused(run_optimizer(folder, {"map.hslam", "--quiet", "--format", "bal"}), 3,
                "cannot be written as bal, only as map or ply");
  const std::string text = read_text(folder.path() / "map.hslam");
  write_text(folder.path() / "short.hslam", text.substr(0, text.size() / 2));
  check_refused(run_optimizer(folder, {"short.hslam", "--quiet"}), 3, "short.hslam");
  write_text(folder.path() / "graph.g2o", "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\n");
  check_refused(run_optimizer(folder, {"graph.g2o", "--quiet", "--format", "map"}), 3,
                "graph.g2o: cannot be written as map, only as g2o");
  Map empty;
  save_map(folder.path() / "empty.hslam", empty.view(), kInfo);
  check_refused(run_optimizer(folder, {"empty.hslam", "--quiet"}), 4, "nothing to optimise");
}

TEST_CASE("map_optimizer: a stereo stream becomes a map") {
  const auto shared = shared_graphs();
  if (!shared) return;
  const TempFolder folder;
  const Json made = run_on_map(
      folder, {(*shared / "stereo_seq/survey-150-stereo.seq").string(), "--format", "map"});
  const Json report = run_on_map(folder, {"out/optimized.hslam", "--robust", "none"}, "again");
  CHECK(report["counts"]["frames"] == 150);
  CHECK(report["counts"]["observations"] == made["counts"]["observations"]);
  CHECK(report["initial_cost"].get<double>() == Approx(29014.602).epsilon(1e-4));
  CHECK(report["final_cost"].get<double>() == Approx(29014.602).epsilon(1e-4));
  CHECK(std::filesystem::exists(folder.path() / "again/optimized.tum"));
}

}  // namespace hybrid_slam
