#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <thread>

#include "backend/backend.h"
#include "backend/map/covisibility.h"
#include "backend/problem/map_graph.h"
#include "backend/problem/problem_solver.h"
#include "backend/problem/solve_bundle.h"
#include "cameras/geometry/se3.h"
#include "test/backend/truth_check.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

const FillOptions kNoisyStart{
    .rotation_noise = 0.01, .translation_noise = 0.03, .point_noise = 0.05};

// Thresholds beyond the noise's reach: the solution is then the plain least squares one, whose
// covariance is known.
ProblemOptions without_rejection() {
  ProblemOptions options;
  options.rounds = {{10, Loss::kHuber, 1e-4}, {20, Loss::kNone, 1e-10}};
  options.chi2_mono = options.chi2_stereo = 60;
  return options;
}

void apply(const BundleResult& result, Map& map) {
  map.move(result.cam_from_world, result.point_in_world);
  MapEdit edit;
  edit.erased_observations = result.outliers;
  map.apply(edit);
}

void check_least_squares(const TruthCheck& check) {
  INFO("worst translation " << check.worst_translation << " m");
  const double freedom = static_cast<double>(check.freedom);
  CHECK(std::abs(check.nees - 1) < 4 * std::sqrt(2 / freedom));
  CHECK(std::abs(check.variance - 1) < 4 * std::sqrt(2 / check.residual_freedom));
}

TEST_CASE("Full bundle adjustment reaches the truth within the noise's covariance") {
  const auto trajectory =
      GENERATE(SceneTrajectory::kCorridor, SceneTrajectory::kHover, SceneTrajectory::kOrbit);
  const SyntheticScene scene =
      make_synthetic_scene({.trajectory = trajectory, .times = 15, .landmarks = 1200});
  FilledMap filled = fill_map(scene, kNoisyStart);
  const Rigid3d origin = filled.map.view().at(filled.keyframes[0]).cam_from_world;
  const double before = check_truth(scene, filled).nees;
  FullBundleOptions options{without_rejection()};
  const BundleResult result =
      solve_bundle(filled.map.view(), make_full_bundle(filled.map.view(), options));
  apply(result, filled.map);
  CHECK(result.summary.end == SolveEnd::kConverged);
  CHECK(result.summary.final_cost < result.summary.initial_cost / 10);
  CHECK(result.summary.variable_poses == 14);
  CHECK(before > 100);
  check_least_squares(check_truth(scene, filled));
  CHECK(filled.map.view().at(filled.keyframes[0]).cam_from_world.params == origin.params);
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
}

TEST_CASE("A stereo pair and a fisheye in one problem reach the truth") {
  const SyntheticScene scene =
      make_synthetic_scene({.trajectory = SceneTrajectory::kHover, .times = 12, .fisheye = true});
  FilledMap filled = fill_map(scene, kNoisyStart);
  FullBundleOptions options{without_rejection()};
  apply(solve_bundle(filled.map.view(), make_full_bundle(filled.map.view(), options)), filled.map);
  const TruthCheck check = check_truth(scene, filled);
  CHECK(check.freedom == 6 * 23);
  check_least_squares(check);
}

TEST_CASE("Wrong matches do not move the solution and are erased") {
  SyntheticSceneOptions options;
  options.times = 15;
  options.landmarks = 2500;
  options.fisheye = GENERATE(false, true);
  options.outlier_rate = 0.08;
  const SyntheticScene scene = make_synthetic_scene(options);
  FilledMap filled = fill_map(scene, kNoisyStart);
  const std::size_t wrong = count_wrong(scene, filled, 1);
  const std::size_t right = count_observations(filled.map.view()) - wrong;
  REQUIRE(wrong > 300);
  apply(solve_bundle(filled.map.view(), make_full_bundle(filled.map.view(), {})), filled.map);
  const std::size_t wrong_left = count_wrong(scene, filled, 1);
  const std::size_t right_left = count_observations(filled.map.view()) - wrong_left;
  CAPTURE(wrong, right, wrong_left, right_left);
  CHECK(wrong_left < wrong / 10);
  CHECK(count_wrong(scene, filled, 4) <= wrong / 100);
  CHECK(static_cast<double>(right_left) > 0.9 * static_cast<double>(right));
  // Cutting the noise's own tails at 95 % costs up to a factor 1.4 in variance.
  const TruthCheck check = check_truth(scene, filled);
  CAPTURE(check.worst_translation);
  CHECK(check.nees < 1.8);
  CHECK(check.nees > 0.8);
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
}

TEST_CASE("Local bundle adjustment takes its window to the truth and leaves the rest alone") {
  const SyntheticScene scene = make_synthetic_scene({.times = 40, .landmarks = 4000});
  FilledMap filled = fill_map(scene, {});
  LocalBundleOptions options;
  options.max_neighbours = 6;
  options.problem = without_rejection();
  const KeyframeId around = filled.keyframes[20];
  const ProblemConfig config = make_local_bundle(filled.map.view(), around, options);
  REQUIRE(config.variable_poses.size() == 7);
  REQUIRE(config.fixed_poses.size() >= 4);

  Random random(5);
  std::vector<std::pair<KeyframeId, Rigid3d>> poses;
  for (const KeyframeId id : config.variable_poses) {
    poses.emplace_back(id, se3_exp(random.vector(6, 0.02)) * filled.map.view().cam_from_world(id));
  }
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> points;
  for (const LandmarkId id : config.variable_landmarks) {
    points.emplace_back(id, filled.map.view().at(id).point_in_world + random.gaussian3(0.05));
  }
  filled.map.move(poses, points);
  apply(solve_bundle(filled.map.view(), make_local_bundle(filled.map.view(), around, options)),
        filled.map);
  double worst = 0;
  for (std::size_t i = 0; i < filled.keyframes.size(); ++i) {
    const Rigid3d& truth = scene.frames[filled.frames[i]].cam_from_world;
    const Rigid3d pose = filled.map.view().cam_from_world(filled.keyframes[i]);
    const bool varies = std::binary_search(config.variable_poses.begin(),
                                           config.variable_poses.end(), filled.keyframes[i]);
    if (!varies) CHECK(pose.params == truth.params);
    worst = std::max(worst, se3_log(pose * inverse(truth)).norm());
  }
  CHECK(worst > 0);
  CHECK(worst < 0.004);
}

TEST_CASE("A local problem names what the map says") {
  const SyntheticScene scene = make_synthetic_scene({.times = 30, .fisheye = true});
  const FilledMap filled = fill_map(scene, {});
  const MapSnapshot& view = filled.map.view();
  for (const KeyframeId around : filled.keyframes) {
    LocalBundleOptions options;
    options.max_neighbours = 10;
    const ProblemConfig config = make_local_bundle(view, around, options);
    std::vector<KeyframeId> all = config.variable_poses;
    all.insert(all.end(), config.fixed_poses.begin(), config.fixed_poses.end());
    std::sort(all.begin(), all.end());
    CHECK(std::adjacent_find(all.begin(), all.end()) == all.end());
    CHECK(std::is_sorted(config.variable_poses.begin(), config.variable_poses.end()));
    CHECK(std::is_sorted(config.fixed_poses.begin(), config.fixed_poses.end()));
    CHECK(config.variable_poses.size() <= 11);
    CHECK_FALSE(std::binary_search(config.variable_poses.begin(), config.variable_poses.end(),
                                   view.origin()));
    for (const KeyframeId id : config.variable_poses) {
      if (id != around) CHECK(shared_landmarks(view.at(id), around) >= 15);
    }
  }
  CHECK(make_local_bundle(view, KeyframeId(999), {}).variable_poses.empty());
  LocalBundleOptions narrow;
  narrow.max_neighbours = 5;
  narrow.max_fixed = 3;
  CHECK(make_local_bundle(view, filled.keyframes[30], narrow).fixed_poses.size() == 3);
}

TEST_CASE("Without an outer observer or the origin the oldest keyframe holds the gauge") {
  const SyntheticScene scene =
      make_synthetic_scene({.trajectory = SceneTrajectory::kHover, .times = 6, .landmarks = 300});
  FilledMap filled = fill_map(scene, {});
  MapEdit edit;  // the origin sees nothing any more
  for (const LandmarkId id : filled.map.view().at(filled.keyframes[0]).landmarks) {
    const Landmark* landmark = filled.map.view().find(id);
    if (landmark != nullptr && landmark->observations.front().keyframe == filled.keyframes[0]) {
      edit.erased_observations.push_back({id, landmark->observations.front()});
    }
  }
  filled.map.apply(edit);
  const ProblemConfig config = make_local_bundle(filled.map.view(), filled.keyframes[3], {});
  CHECK(config.fixed_poses == std::vector<KeyframeId>{filled.keyframes[1]});
  CHECK(config.variable_poses.size() == 4);
}

TEST_CASE("The facade optimises its map, erases outliers, and repeats bit for bit") {
  const SyntheticScene scene =
      make_synthetic_scene({.times = 12, .landmarks = 800, .outlier_rate = 0.05, .seed = 4});
  BackendOptions options;
  options.local_method = GENERATE(LocalMethod::kBundle, LocalMethod::kIncremental);
  const auto run = [&] {
    Backend backend(options);
    for (const Camera& camera : scene.cameras) backend.add_camera(camera);
    std::vector<LandmarkId> born(scene.points_in_world.size());
    for (const SyntheticFrame& frame : scene.frames) {
      NewKeyframe made{frame.observations, frame.cam_from_world, {}, {}, backend.view().origin()};
      made.landmarks.resize(frame.landmark.size());
      for (std::uint32_t k = 0; k < frame.landmark.size(); ++k) {
        const auto index = static_cast<std::size_t>(frame.landmark[k]);
        made.landmarks[k] = born[index];
        if (!born[index].valid() && frame.observations->has_right(k)) {
          made.new_points.emplace_back(k, scene.points_in_world[index]);
        }
      }
      const KeyframeId id = backend.add(made);
      for (std::size_t k = 0; k < frame.landmark.size(); ++k) {
        const LandmarkId landmark = backend.view().at(id).landmarks[k];
        if (landmark.valid()) born[static_cast<std::size_t>(frame.landmark[k])] = landmark;
      }
      const auto before = backend.snapshot();
      const BundleSummary summary = backend.optimize_local(id);
      CHECK(summary.end != SolveEnd::kFailed);
      CHECK(summary.final_cost <= summary.initial_cost);
      CHECK(count_observations(*before) - count_observations(backend.view()) >=
            static_cast<std::size_t>(summary.outliers));
      CHECK(before->at(id).cam_from_world.params == frame.cam_from_world.params);
    }
    backend.optimize_full();
    CHECK(backend.map().check_consistency() == std::vector<std::string>{});
    std::vector<Vector7d> poses;
    for (const KeyframeId id : backend.view().keyframe_ids()) {
      poses.push_back(backend.view().at(id).cam_from_world.params);
    }
    return poses;
  };
  const auto poses = run();
  CHECK(poses == run());
  CHECK(poses.size() == 12);
  CHECK(poses.front() == scene.frames.front().cam_from_world.params);
}

TEST_CASE("A stopped optimisation keeps what it has and erases nothing") {
  const SyntheticScene scene = make_synthetic_scene({.times = 20, .outlier_rate = 0.05});
  FilledMap filled = fill_map(scene, kNoisyStart);
  const ProblemConfig config = make_full_bundle(filled.map.view(), {});

  std::stop_source stopped;
  stopped.request_stop();
  const BundleResult at_once = solve_bundle(filled.map.view(), config, stopped.get_token());
  CHECK(at_once.summary.end == SolveEnd::kStopped);
  CHECK(at_once.summary.iterations == 0);
  CHECK(at_once.outliers.empty());

  std::stop_source later;
  const std::jthread stopper([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    later.request_stop();
  });
  ProblemConfig endless = config;
  endless.options.rounds = {{10000, Loss::kNone, 0}};
  const BundleResult result = solve_bundle(filled.map.view(), endless, later.get_token());
  CHECK((result.summary.end == SolveEnd::kStopped || result.summary.end == SolveEnd::kConverged));
  CHECK(result.summary.iterations < 10000);
  CHECK(result.summary.final_cost <= result.summary.initial_cost);
  apply(result, filled.map);
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
}

TEST_CASE("A point behind its camera is set aside, erased, and harms nothing") {
  const SyntheticScene scene = make_synthetic_scene({.times = 6, .landmarks = 500});
  FilledMap filled = fill_map(scene, {});
  const KeyframeId observer = filled.keyframes[2];
  const auto& seen = filled.map.view().at(observer).landmarks;
  const LandmarkId victim =
      *std::find_if(seen.begin(), seen.end(), [](LandmarkId id) { return id.valid(); });
  const Rigid3d world_from_cam = inverse(filled.map.view().at(observer).cam_from_world);
  filled.map.move({}, {{victim, world_from_cam * Eigen::Vector3d(0, 0, -4)}});
  const BundleResult result =
      solve_bundle(filled.map.view(), make_full_bundle(filled.map.view(), {}));
  CHECK(result.summary.end != SolveEnd::kFailed);
  CHECK(std::count_if(result.outliers.begin(), result.outliers.end(), [&](const auto& outlier) {
          return outlier.landmark == victim && outlier.observation.keyframe == observer;
        }) == 1);
  apply(result, filled.map);
  CHECK(check_truth(scene, filled).nees < 1.8);
}

TEST_CASE("No result comes from values that are not finite, from nothing, or from bad options") {
  const SyntheticScene scene = make_synthetic_scene({.times = 4, .landmarks = 300});
  FilledMap filled = fill_map(scene, {});
  ProblemConfig config = make_full_bundle(filled.map.view(), {});
  FactorGraph graph = make_graph(filled.map.view(), config).graph;
  const GraphFactors factors = make_factors(graph);
  graph.frames[0].cam_from_world.translation().x() = std::numeric_limits<double>::quiet_NaN();
  CHECK(solve_round(graph, factors, {}, {5, Loss::kNone, 0}, {}).end == SolveEnd::kFailed);
  CHECK_THROWS_AS(solve_graph(graph, {}), std::invalid_argument);

  CHECK(solve_bundle(filled.map.view(), {}).summary.end == SolveEnd::kEmpty);
  ProblemConfig stale = config;  // as if made from an older snapshot
  stale.variable_poses.emplace_back(900);
  stale.variable_landmarks.emplace_back(90000);
  const BundleResult result = solve_bundle(filled.map.view(), stale);
  CHECK(result.cam_from_world.size() == 3);
  CHECK(result.point_in_world.size() == filled.map.view().landmark_count());

  config.options.threads = 0;
  CHECK_THROWS_AS(solve_bundle(filled.map.view(), config), std::invalid_argument);
  BackendOptions options;
  options.local.problem.rounds.clear();
  CHECK_THROWS_AS(Backend(options), std::invalid_argument);
}

}  // namespace
}  // namespace hybrid_slam
