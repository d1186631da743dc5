#include "frontend/tracking/local_map.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <set>

#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

FilledMap orbit_map(bool fisheye) {
  SyntheticSceneOptions options;
  options.times = 24;
  options.fisheye = fisheye;
  return fill_map(make_synthetic_scene(options), {});
}

std::map<KeyframeId, int> count_shared(const MapSnapshot& map,
                                       const std::vector<LandmarkId>& tracked) {
  std::map<KeyframeId, int> shared;
  for (const LandmarkId id : tracked) {
    if (map.find(id) == nullptr) continue;
    for (const Observation& observation : map.at(id).observations) ++shared[observation.keyframe];
  }
  return shared;
}

TEST_CASE("The local map is what shares landmarks, most first, with all its landmarks once") {
  const FilledMap filled = orbit_map(true);
  const MapSnapshot& map = filled.map.view();
  const std::vector<LandmarkId> tracked = map.at(filled.keyframes[20]).landmarks;
  const auto shared = count_shared(map, tracked);
  const LocalMap local = make_local_map(map, tracked, {});

  REQUIRE(local.keyframes.size() >= shared.size());
  CHECK(local.reference == local.keyframes.front());
  for (std::size_t i = 0; i < shared.size(); ++i) {
    REQUIRE(shared.contains(local.keyframes[i]));
    if (i > 0) CHECK(shared.at(local.keyframes[i - 1]) >= shared.at(local.keyframes[i]));
  }
  std::set<CameraId> cameras;
  std::set<LandmarkId> expected;
  for (const KeyframeId id : local.keyframes) {
    cameras.insert(map.at(id).observations->camera);
    for (const LandmarkId landmark : map.at(id).landmarks) {
      if (landmark.valid()) expected.insert(landmark);
    }
  }
  CHECK(cameras.size() == 2);
  CHECK(local.landmarks.size() == expected.size());
  CHECK(std::set(local.landmarks.begin(), local.landmarks.end()) == expected);
  CHECK(std::set(local.keyframes.begin(), local.keyframes.end()).size() == local.keyframes.size());
}

TEST_CASE("Neighbours of those that share landmarks are local too") {
  const FilledMap filled = orbit_map(false);
  const MapSnapshot& map = filled.map.view();
  const std::vector<LandmarkId> tracked = map.at(filled.keyframes[5]).landmarks;
  LocalMapOptions options;
  options.neighbours_per_keyframe = 3;
  const LocalMap local = make_local_map(map, tracked, options);
  const std::set members(local.keyframes.begin(), local.keyframes.end());
  for (const auto& [id, count] : count_shared(map, tracked)) {
    for (const Covisible& covisible : map.covisible(id, 1, 3))
      CHECK(members.contains(covisible.id));
    for (const KeyframeId child : map.at(id).children) CHECK(members.contains(child));
  }
}

TEST_CASE("The local map keeps to its limit and starts with the best") {
  const FilledMap filled = orbit_map(false);
  const MapSnapshot& map = filled.map.view();
  const std::vector<LandmarkId> tracked = map.at(filled.keyframes[5]).landmarks;
  LocalMapOptions options;
  options.max_keyframes = 1;
  const LocalMap local = make_local_map(map, tracked, options);
  CHECK(local.keyframes == std::vector<KeyframeId>{filled.keyframes[5]});
  const auto seen =
      std::count_if(tracked.begin(), tracked.end(), [](LandmarkId id) { return id.valid(); });
  CHECK(std::ssize(local.landmarks) == seen);
}

TEST_CASE("Landmarks that are gone or invalid have no vote") {
  const FilledMap filled = orbit_map(false);
  const MapSnapshot& map = filled.map.view();
  CHECK(!make_local_map(map, {}, {}).reference.valid());
  CHECK(!make_local_map(map, {LandmarkId(), LandmarkId(1000000)}, {}).reference.valid());
}

}  // namespace
}  // namespace hybrid_slam
