// Loops closed by the backend's facade.
#include "backend/backend.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "backend/incremental/map_smoother.h"
#include "cameras/geometry/se3.h"
#include "test/backend/drifted_circle.h"
#include "test/support/random.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

BackendOptions chain_backend() {
  BackendOptions options;
  options.loops.graph = chain_options();
  return options;
}

// A circle whose two ends do not know one another: the landmarks that the last `again` keyframes
// share with the first ones exist twice.
struct OpenCircle {
  explicit OpenCircle(Backend& backend) : backend(backend) {
    SyntheticSceneOptions scene_options;
    scene_options.trajectory = SceneTrajectory::kOrbit;
    scene_options.times = 26;
    scene_options.step = 2 * 3.14159265 * 3 / 24;  // two keyframes more than a lap
    scene_options.landmarks = 1500;
    scene_options.noise = 0.05;
    scene = make_synthetic_scene(scene_options);
    for (const Camera& camera : scene.cameras) backend.add_camera(camera);
    first.resize(scene.points_in_world.size());
    second.resize(scene.points_in_world.size());
    for (std::size_t i = 0; i < scene.frames.size(); ++i) add(i);
  }

  void add(std::size_t i) {
    const SyntheticFrame& frame = scene.frames[i];
    auto& known = i < 20 ? first : second;  // by landmark of the scene
    // Every step is off by a little.
    const Rigid3d drift = se3_exp(static_cast<double>(i) * 0.3 * small_drift());
    const Rigid3d cam_from_world = drift * frame.cam_from_world;
    const KeyframeId previous = keyframes.empty() ? KeyframeId() : keyframes.back();
    NewKeyframe made{frame.observations, cam_from_world, {}, {}, previous};
    made.landmarks.resize(frame.landmark.size());
    for (std::uint32_t k = 0; k < frame.landmark.size(); ++k) {
      const auto index = static_cast<std::size_t>(frame.landmark[k]);
      // What begins before the split and is seen after it stays one, but for the first keyframes'.
      const bool carried = i >= 20 && i < 23 && first[index].valid() && !seen_early(index);
      made.landmarks[k] = carried ? first[index] : known[index];
      if (made.landmarks[k].valid() || !frame.observations->has_right(k)) continue;
      const Eigen::Vector3d in_cam = frame.cam_from_world * scene.points_in_world[index];
      made.new_points.emplace_back(k, inverse(cam_from_world) * in_cam);
    }
    const KeyframeId id = backend.add(made);
    for (std::size_t k = 0; k < frame.landmark.size(); ++k) {
      const auto index = static_cast<std::size_t>(frame.landmark[k]);
      const LandmarkId landmark = backend.view().at(id).landmarks[k];
      if (landmark.valid() && landmark != first[index]) known[index] = landmark;
    }
    keyframes.push_back(id);
  }

  bool seen_early(std::size_t index) const {
    return std::any_of(scene.frames.begin(), scene.frames.begin() + 5, [&](const auto& frame) {
      return std::count(frame.landmark.begin(), frame.landmark.end(), static_cast<int>(index)) > 0;
    });
  }

  // What a perfect verification of the last keyframe against the one a lap before would say.
  LoopMeasurement loop() const {
    LoopMeasurement measured;
    measured.keyframe = keyframes[25];
    measured.match = keyframes[1];
    measured.keyframe_from_match =
        Sim3d(scene.frames[25].cam_from_world * inverse(scene.frames[1].cam_from_world));
    for (const int index : scene.frames[25].landmark) {
      const auto i = static_cast<std::size_t>(index);
      if (first[i].valid() && second[i].valid()) measured.same.push_back({first[i], second[i]});
    }
    return measured;
  }

  double worst_error() const {
    double worst = 0;
    for (std::size_t i = 0; i < scene.frames.size(); ++i) {
      const auto at = origin_in_a(backend.view().at(keyframes[i]).cam_from_world);
      worst = std::max(worst, (at - origin_in_a(scene.frames[i].cam_from_world)).norm());
    }
    return worst;
  }

  Backend& backend;
  SyntheticScene scene;
  std::vector<LandmarkId> first;
  std::vector<LandmarkId> second;
  std::vector<KeyframeId> keyframes;
};

TEST_CASE("backend: a loop moves the map, merges its sides and is kept") {
  Backend backend(chain_backend());
  OpenCircle circle(backend);
  const LoopMeasurement loop = circle.loop();
  REQUIRE(loop.same.size() > 50);
  const double before = circle.worst_error();
  const std::size_t landmarks = backend.view().landmark_count();
  const LoopOutcome outcome = backend.close(loop);
  REQUIRE(outcome.end == LoopEnd::kClosed);
  CHECK(outcome.loops == 1);
  CHECK(outcome.translation > 0.05);
  CHECK(backend.view().landmark_count() == landmarks - loop.same.size());
  CHECK(backend.view().at(loop.keyframe).keep);
  CHECK(backend.view().at(loop.match).keep);
  CHECK(backend.map().check_consistency() == std::vector<std::string>{});
  const double closed = circle.worst_error();
  CHECK(closed < 0.7 * before);  // by the graph alone, which spreads what the ends were off
  // What is one now holds the ends together: the smoother, then everything.
  backend.optimize_local(circle.keyframes.back());
  CHECK(circle.worst_error() < 0.3 * before);
  backend.optimize_full();
  CHECK(circle.worst_error() < 0.02);
  CHECK(backend.map().check_consistency() == std::vector<std::string>{});
}

TEST_CASE("backend: an adjustment of everything is carried over a loop that was closed meanwhile") {
  Backend backend(chain_backend());
  OpenCircle circle(backend);
  const auto snapshot = backend.snapshot();
  const double open = circle.worst_error();
  BundleResult adjusted = solve_full(*snapshot, {});  // the ends do not know one another
  const BundleResult as_solved = adjusted;
  REQUIRE(backend.close(circle.loop()).end == LoopEnd::kClosed);
  CHECK(backend.closings() == 1);
  const auto before = backend.snapshot();
  backend.take_in_full(std::move(adjusted), 0);
  CHECK(backend.map().check_consistency() == std::vector<std::string>{});
  // Each keyframe moves before its place as the adjustment moved it, wherever the loop took it.
  for (const auto& [id, pose] : as_solved.cam_from_world) {
    const Rigid3d wanted = pose * inverse(snapshot->at(id).cam_from_world);
    const Rigid3d got =
        backend.view().at(id).cam_from_world * inverse(before->at(id).cam_from_world);
    CHECK((wanted.params - got.params).norm() < 1e-9);
  }
  // The loop is not undone, and where both corrected the same, the smoother has the last word.
  CHECK(circle.worst_error() < open);
  backend.optimize_local(circle.keyframes.back());
  backend.catch_up();
  CHECK(circle.worst_error() < 0.3 * open);
  CHECK_THROWS_AS(backend.take_in_full({}, 2), std::logic_error);
  backend.optimize_full();  // of the closed map: an older result is left out from now on
  const auto newest = backend.snapshot();
  backend.take_in_full(as_solved, 0);
  CHECK(newest->changed_keyframes(backend.view()).empty());
  CHECK(circle.worst_error() < 0.02);
}

// What came into the map between `began` and `before`, this keyframe and landmarks that it alone
// sees, lies before the keyframe it hangs from as it did.
void check_carried(const MapSnapshot& began, const MapSnapshot& before, KeyframeId newcomer,
                   const MapSnapshot& now) {
  const KeyframeId parent = before.at(newcomer).parent;
  const Rigid3d moved = now.at(parent).cam_from_world * inverse(before.at(parent).cam_from_world);
  REQUIRE(moved.translation().norm() > 1e-3);
  const auto in_parent = [&](const MapSnapshot& map) {
    return map.at(newcomer).cam_from_world * inverse(map.at(parent).cam_from_world);
  };
  CHECK((in_parent(now).params - in_parent(before).params).norm() < 1e-12);
  int carried = 0;
  for (const LandmarkId id : now.landmark_ids()) {
    if (began.find(id) != nullptr) continue;
    const Eigen::Vector3d was = before.at(newcomer).cam_from_world * before.at(id).point_in_world;
    const Eigen::Vector3d is = now.at(newcomer).cam_from_world * now.at(id).point_in_world;
    CHECK((is - was).norm() < 1e-9);
    ++carried;
  }
  CHECK(carried > 10);
}

// While an update works: nothing else moves the map.
void check_nothing_moves(Backend& backend, const LoopMeasurement& loop, KeyframeId newcomer) {
  const auto before = backend.snapshot();
  CHECK_THROWS_AS(backend.optimize_local(newcomer), std::logic_error);
  CHECK_THROWS_AS(backend.close(loop), std::logic_error);
  CHECK_THROWS_AS(backend.take_in_full({}, 0), std::logic_error);
  CHECK_THROWS_AS(backend.catch_up(), std::logic_error);
  CHECK_THROWS_AS(backend.drop_features({newcomer}), std::logic_error);
  CHECK(before->changed_keyframes(backend.view()).empty());
}

// A keyframe beside that of this time; all that it sees is new.
KeyframeId add_stranger(OpenCircle& circle, int time) {
  circle.second.assign(circle.second.size(), LandmarkId());
  circle.add(time);
  return circle.keyframes.back();
}

TEST_CASE("backend: what comes in while a local update works is carried along") {
  Backend backend(chain_backend());
  OpenCircle circle(backend);
  LocalUpdate update = backend.begin_local(std::vector{circle.keyframes.back()});
  const auto began = backend.snapshot();
  const KeyframeId newcomer = add_stranger(circle, 25);
  const auto before = backend.snapshot();
  check_nothing_moves(backend, circle.loop(), newcomer);
  update.run();
  backend.end_local(std::move(update));
  check_carried(*began, *before, newcomer, backend.view());
  CHECK(backend.map().check_consistency() == std::vector<std::string>{});
  CHECK(backend.close(circle.loop()).end == LoopEnd::kClosed);
}

TEST_CASE("backend: what comes in while a loop is being closed is carried along") {
  Backend backend(chain_backend());
  OpenCircle circle(backend);
  const LoopMeasurement loop = circle.loop();
  LoopUpdate update = backend.begin_close(loop);
  const auto began = backend.snapshot();
  const KeyframeId newcomer = add_stranger(circle, 25);
  const auto before = backend.snapshot();
  check_nothing_moves(backend, loop, newcomer);
  CHECK(backend.closings() == 0);
  update.run();
  const double open = circle.worst_error();
  CHECK(backend.end_close(std::move(update)).end == LoopEnd::kClosed);
  CHECK(backend.closings() == 1);
  CHECK(circle.worst_error() < 0.7 * open);
  check_carried(*began, *before, newcomer, backend.view());
  CHECK(backend.map().check_consistency() == std::vector<std::string>{});
}

TEST_CASE("backend: a map that is too large for one adjustment has it in windows") {
  BackendOptions options = chain_backend();
  Backend whole(options);
  OpenCircle circle(whole);
  REQUIRE(whole.close(circle.loop()).end == LoopEnd::kClosed);
  options.full.max_keyframes = whole.view().keyframe_count() / 3;
  Backend parts(options);
  OpenCircle same(parts);
  REQUIRE(parts.close(same.loop()).end == LoopEnd::kClosed);
  CHECK(make_full_bundle(whole.view(), chain_backend().full).window == 0);
  CHECK(make_full_bundle(parts.view(), options.full).window == options.full.max_keyframes);
  const BundleSummary at_once = whole.optimize_full();
  const BundleSummary in_windows = parts.optimize_full();
  CHECK(in_windows.variable_poses == at_once.variable_poses);
  CHECK(in_windows.variable_landmarks == at_once.variable_landmarks);
  CHECK(in_windows.end == SolveEnd::kConverged);
}

TEST_CASE("backend: a loop that is not believed changes nothing") {
  Backend backend(chain_backend());
  OpenCircle circle(backend);
  Random random(4);
  const auto before = backend.snapshot();
  for (int i = 0; i < 20; ++i) {
    LoopMeasurement wrong = circle.loop();
    Vector6d tangent;
    tangent << random.gaussian3(2), random.gaussian3(1);
    wrong.keyframe_from_match = Sim3d(se3_exp(tangent));
    CHECK(backend.close(wrong).end == LoopEnd::kImplausible);
  }
  for (const KeyframeId id : circle.keyframes) {
    CHECK(backend.view().at(id).cam_from_world.params == before->at(id).cam_from_world.params);
  }
  CHECK(backend.view().landmark_count() == before->landmark_count());
  CHECK(backend.close(circle.loop()).end == LoopEnd::kClosed);  // they do not keep it out
}

TEST_CASE("backend: a loop of a keyframe that has gone is none") {
  Backend backend(chain_backend());
  OpenCircle circle(backend);
  LoopMeasurement loop = circle.loop();
  MapEdit edit;
  edit.erased_keyframes = {loop.keyframe};
  backend.apply(edit);
  CHECK(backend.close(loop).end == LoopEnd::kGone);
}

TEST_CASE("smoother: with a window, a loop holds the present to a past that does not vary") {
  Backend backend(chain_backend());
  const OpenCircle circle(backend);
  const auto map = backend.snapshot();
  // Ten centimetres from where everything else puts it, and sure of it.
  const LoopMeasurement loop = circle.loop();
  const Rigid3d shift(Eigen::Quaterniond::Identity(), {0.1, 0, 0});
  PoseConstraint edge{loop.keyframe, loop.match, Sim3d(shift) * loop.keyframe_from_match};
  edge.information = 1e8 * Matrix7d::Identity();
  const auto off_after = [&](bool with_loop) {
    MapSmootherOptions options;
    options.solver.window = 6;
    options.solver.loop_loss = Loss::kNone;
    MapSmoother smoother(options);
    BundleResult moved = smoother.update(map, loop.keyframe);  // marginalises the match
    if (with_loop) smoother.add_loop(edge);
    std::map<KeyframeId, Rigid3d> poses;
    for (int i = 0; i < 5; ++i) {
      for (const auto& [id, pose] : moved.cam_from_world) poses[id] = pose;
      moved = smoother.update(map, loop.keyframe);
    }
    for (const auto& [id, pose] : moved.cam_from_world) poses[id] = pose;
    const Rigid3d motion = poses.at(loop.keyframe) * inverse(poses.at(loop.match));
    return (inverse(without_scale(edge.a_from_b)) * motion).translation().norm();
  };
  CHECK(off_after(false) > 0.05);
  CHECK(off_after(true) < 0.005);
}

}  // namespace
}  // namespace hybrid_slam
