// The map optimised by steps, while others change it.
#include <algorithm>
#include <set>
#include <stdexcept>
#include <tuple>
#include <utility>

#include <catch2/catch.hpp>

#include "backend/backend.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

BackendOptions by(LocalMethod method) {
  BackendOptions options;
  options.local_method = method;
  return options;
}

using Seen = std::tuple<LandmarkId, KeyframeId, std::uint32_t>;

std::set<Seen> observations(const MapSnapshot& map) {
  std::set<Seen> all;
  for (const LandmarkId id : map.landmark_ids()) {
    for (const Observation& seen : map.at(id).observations) {
      all.emplace(id, seen.keyframe, seen.keypoint);
    }
  }
  return all;
}

// What an update around these keyframes takes out of a map of a circle with wrong matches.
std::set<Seen> outliers(LocalMethod method, const std::vector<std::size_t>& newest) {
  SyntheticSceneOptions scene;
  scene.trajectory = SceneTrajectory::kOrbit;
  scene.times = 24;
  scene.landmarks = 2000;
  scene.outlier_rate = 0.02;
  FilledMap filled = fill_map(make_synthetic_scene(scene), {});
  const std::set<Seen> before = observations(filled.map.view());
  std::vector<KeyframeId> ids;
  for (const std::size_t i : newest) ids.push_back(filled.keyframes[i]);
  Backend backend(by(method), std::move(filled.map));
  LocalUpdate update = backend.begin_local(ids);
  update.run();
  backend.end_local(std::move(update));
  std::set<Seen> gone = before;
  for (const Seen& one : observations(backend.view())) gone.erase(one);
  return gone;
}

TEST_CASE("backend: an update looks for outliers in all keyframes that came since the last") {
  for (const LocalMethod method : {LocalMethod::kIncremental, LocalMethod::kBundle}) {
    // From opposite sides of the circle they see no ground in common.
    const std::set<Seen> first = outliers(method, {5});
    const std::set<Seen> second = outliers(method, {17});
    const std::set<Seen> both = outliers(method, {5, 17});
    const auto alone = [](const std::set<Seen>& a, const std::set<Seen>& b) {
      return std::count_if(a.begin(), a.end(), [&](const Seen& one) { return !b.contains(one); });
    };
    INFO(first.size() << " " << second.size() << " " << both.size());
    REQUIRE(alone(first, second) > 5);
    REQUIRE(alone(second, first) > 5);
    // Where two surroundings are adjusted as one, the estimate is another by its noise.
    CHECK(10 * alone(first, both) < static_cast<std::ptrdiff_t>(first.size()));
    CHECK(10 * alone(second, both) < static_cast<std::ptrdiff_t>(second.size()));
  }
}

struct Growing {
  SyntheticScene scene;
  FilledMap filled;
  Backend backend;

  static SyntheticScene corridor() {
    SyntheticSceneOptions options;
    options.trajectory = SceneTrajectory::kCorridor;
    options.times = 16;
    options.landmarks = 1200;
    return make_synthetic_scene(options);
  }
  static FilledMap first(SyntheticScene scene) {
    scene.frames.resize(10);
    FillOptions fill;  // so that there is something to be moved
    fill.translation_noise = 0.02;
    fill.point_noise = 0.02;
    return fill_map(scene, fill);
  }

  Growing()
      : scene(corridor()), filled(first(scene)), backend(BackendOptions(), std::move(filled.map)) {}

  // Of the i-th frame. `known`: by landmark of the scene; what is none and seen in stereo is born.
  KeyframeId add(std::size_t i, const std::vector<LandmarkId>& known) {
    const SyntheticFrame& frame = scene.frames[i];
    NewKeyframe made{frame.observations, frame.cam_from_world, {}, {}, filled.keyframes.back()};
    made.landmarks.resize(frame.landmark.size());
    for (std::uint32_t k = 0; k < frame.landmark.size(); ++k) {
      if (frame.landmark[k] < 0) continue;
      const auto index = static_cast<std::size_t>(frame.landmark[k]);
      made.landmarks[k] = known[index];
      if (!known[index].valid() && frame.observations->has_right(k)) {
        made.new_points.emplace_back(k, scene.points_in_world[index]);
      }
    }
    const KeyframeId id = backend.add(made);
    for (std::size_t k = 0; k < frame.landmark.size(); ++k) {
      const LandmarkId landmark = backend.view().at(id).landmarks[k];
      if (landmark.valid())
        filled.landmarks[static_cast<std::size_t>(frame.landmark[k])] = landmark;
    }
    return id;
  }

  LocalUpdate begin() {
    const KeyframeId newest = backend.view().keyframe_ids().back();
    return backend.begin_local({&newest, 1});
  }
};

Rigid3d motion(const MapSnapshot& before, const MapSnapshot& now, KeyframeId id) {
  return inverse(now.at(id).cam_from_world) * before.at(id).cam_from_world;
}

TEST_CASE("backend: an update is taken in by a map from which much has gone meanwhile") {
  Growing growing;
  Backend& backend = growing.backend;
  LocalUpdate update = growing.begin();
  update.run();
  const std::vector<KeyframeId> old = backend.view().keyframe_ids();
  MapEdit edit;
  edit.erased_keyframes = {old[4], old.back()};  // the newest one, for which it was begun, too
  const auto& seen = backend.view().at(old[5]).landmarks;
  for (std::size_t k = 0, n = 0; k < seen.size() && n < 60; ++k) {
    if (seen[k].valid() && n++ % 2 == 0) edit.erased_landmarks.push_back(seen[k]);
  }
  std::vector<LandmarkId> left;
  for (const LandmarkId id : backend.view().at(old[6]).landmarks) {
    const bool gone =
        std::count(edit.erased_landmarks.begin(), edit.erased_landmarks.end(), id) > 0;
    if (id.valid() && !gone) left.push_back(id);
  }
  edit.merged = {{left[0], left[1]}, {left[2], left[3]}};
  backend.apply(edit);
  growing.add(10, growing.filled.landmarks);
  const auto before = backend.snapshot();
  backend.end_local(std::move(update));
  CHECK(backend.map().check_consistency() == std::vector<std::string>{});
  CHECK(motion(*before, backend.view(), old[7]).translation().norm() > 1e-4);
  CHECK(backend.view().find(left[1]) == nullptr);
  // The smoother hears of all that in its next update.
  backend.optimize_local(growing.add(11, growing.filled.landmarks));
  CHECK(backend.map().check_consistency() == std::vector<std::string>{});
  for (std::size_t i = 5; i < 9; ++i) {
    const Rigid3d off =
        growing.scene.frames[i].cam_from_world * inverse(backend.view().at(old[i]).cam_from_world);
    CHECK(off.translation().norm() < 0.01);
  }
}

// A keyframe that came meanwhile goes again, and of those that hung from it the older one hangs
// from the newer one, which alone shares landmarks with the map before.
TEST_CASE("backend: what came meanwhile is carried along, whatever it hangs from") {
  Growing growing;
  Backend& backend = growing.backend;
  LocalUpdate update = growing.begin();
  update.run();
  const std::vector<LandmarkId> first = growing.filled.landmarks;
  const std::vector<LandmarkId> none(first.size());
  const KeyframeId bridge = growing.add(10, none);
  const std::vector<LandmarkId> of_bridge = growing.filled.landmarks;
  std::vector<LandmarkId> known = none;
  for (std::size_t i = 0; i < known.size(); i += 2) known[i] = of_bridge[i];
  const KeyframeId older = growing.add(11, known);
  known = of_bridge;
  for (std::size_t i = 1; i < known.size(); i += 4) known[i] = first[i];
  const KeyframeId newer = growing.add(12, known);
  MapEdit edit;
  edit.erased_keyframes = {bridge};
  backend.apply(edit);
  const MapSnapshot& map = backend.view();
  REQUIRE(map.at(older).parent == newer);
  const KeyframeId above = map.at(newer).parent;
  REQUIRE(above < bridge);
  const auto before = backend.snapshot();
  backend.end_local(std::move(update));
  const Rigid3d moved = motion(*before, map, above);
  REQUIRE(moved.translation().norm() > 1e-4);
  for (const KeyframeId id : {older, newer}) {
    CHECK((motion(*before, map, id).params - moved.params).norm() < 1e-9);
  }
}

TEST_CASE("backend: the steps of an update come in order") {
  Growing growing;
  Backend& backend = growing.backend;
  CHECK_THROWS_AS(backend.begin_local({}), std::logic_error);
  LocalUpdate update = growing.begin();
  CHECK_THROWS_AS(growing.begin(), std::logic_error);
  update.run();
  backend.end_local(std::move(update));
  Growing other;
  LocalUpdate foreign = other.begin();
  CHECK_THROWS_AS(backend.end_local(std::move(foreign)), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
