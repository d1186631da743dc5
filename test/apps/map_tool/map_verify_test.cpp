// Maps broken on purpose.
#include "apps/map_tool/map_verify.h"

#include <catch2/catch.hpp>

#include "test/apps/map_tool/tool_maps.h"

namespace hybrid_slam {
namespace {

FilledMap sound_map() {
  return map_of_frames(make_synthetic_scene(small_orbit(12, true)), 0, 24, 1);
}

bool tells(const std::vector<std::string>& faults, const std::string& begin,
           const std::string& part) {
  return std::any_of(faults.begin(), faults.end(), [&](const std::string& fault) {
    return fault.starts_with(begin) && fault.find(part) != std::string::npos;
  });
}

std::vector<std::string> faults_of_tables(MapTables tables) {
  return map_faults(MapFileAccess::make(std::move(tables)));
}

// A landmark that several keyframes see.
LandmarkId well_seen(const MapSnapshot& map) {
  for (const LandmarkId id : map.landmark_ids()) {
    if (map.at(id).observations.size() >= 4) return id;
  }
  return {};
}

}  // namespace

TEST_CASE("a sound map has no faults") {
  const FilledMap filled = sound_map();
  CHECK(map_faults(filled.map).empty());
}

TEST_CASE("the bound of a chi2 tail is above it, and not by much") {
  // P(chi2_2 > x) = exp(-x / 2), of which the bound is at most e x / 2 times as much.
  for (const double x : {5.0, 20.0, 60.0}) {
    CHECK(chi2_tail_bound(x, 2) >= std::exp(-x / 2));
    CHECK(chi2_tail_bound(x, 2) == Approx(std::exp(1 - x / 2) * x / 2));
  }
  CHECK(chi2_tail_bound(1.9, 2) == 1);
}

TEST_CASE("verify: a keyframe that is elsewhere") {
  FilledMap filled = sound_map();
  const KeyframeId id(6);
  Rigid3d pose = filled.map.view().at(id).cam_from_world;
  pose.translation().x() += 0.1;
  filled.map.move({{id, pose}}, {});
  const auto faults = map_faults(filled.map);
  CHECK(tells(faults, "keyframe 6: ", "beyond chance"));
  for (const KeyframeId other : filled.map.view().keyframe_ids()) {
    if (other != id) CHECK(!tells(faults, "keyframe " + std::to_string(other.value) + ": ", ""));
  }
}

TEST_CASE("verify: a landmark that is elsewhere, and one behind a camera") {
  FilledMap filled = sound_map();
  const LandmarkId id = well_seen(filled.map.view());
  const Landmark landmark = filled.map.view().at(id);
  const std::string name = "landmark " + std::to_string(id.value) + ": ";
  filled.map.move({}, {{id, landmark.point_in_world + Eigen::Vector3d(0.1, 0.1, 0)}});
  const auto aside = map_faults(filled.map);
  CHECK(aside.size() == 1);
  CHECK(tells(aside, name, "beyond chance"));
  const Keyframe& stereo = filled.map.view().at(KeyframeId(0));
  const auto seen = std::find_if(stereo.landmarks.begin(), stereo.landmarks.end(),
                                 [](LandmarkId one) { return one.valid(); });
  filled.map.move({}, {{id, landmark.point_in_world},
                       {*seen, inverse(stereo.cam_from_world) * Eigen::Vector3d(0, 0, -1)}});
  CHECK(tells(map_faults(filled.map), "keyframe 0: ", "not in front of its camera"));
}

TEST_CASE("verify: references, rotations, keypoints") {
  FilledMap filled = sound_map();
  const LandmarkId id = well_seen(filled.map.view());
  const Observation seen = filled.map.view().at(id).observations.front();

  MapTables one_way = tables_of(filled.map);
  one_way.keyframes.edit(seen.keyframe.value).landmarks[seen.keypoint] = LandmarkId();
  CHECK(tells(faults_of_tables(std::move(one_way)), "landmark " + std::to_string(id.value),
              "does not know of it"));

  MapTables missing = tables_of(filled.map);
  missing.landmarks.erase(id.value);
  CHECK(tells(faults_of_tables(std::move(missing)), "keyframe ", "does not exist"));

  MapTables infinite = tables_of(filled.map);
  infinite.keyframes.edit(3).cam_from_world.translation().y() = INFINITY;
  CHECK(tells(faults_of_tables(std::move(infinite)), "keyframe 3: ", "not finite"));

  Rigid3d stretched = filled.map.view().at(KeyframeId(23)).cam_from_world;
  stretched.params.head<4>() *= 1 + 1e-5;
  filled.map.move({{KeyframeId(23), stretched}}, {});
  CHECK(tells(map_faults(filled.map), "keyframe 23: ", "not orthonormal"));
}

TEST_CASE("verify: components that are one, and one that is two") {
  FilledMap filled = sound_map();
  MapTables two = tables_of(filled.map);
  for (std::uint32_t i = 10; i < 24; ++i) two.keyframes.edit(i).component = KeyframeId(10);
  const auto faults = faults_of_tables(std::move(two));
  CHECK(tells(faults, "keyframes ", "are in components 0 and 10"));
  CHECK(tells(faults, "keyframes ", "joined by odometry"));

  // Two parts that share nothing, which the spanning tree alone joins.
  FillOptions split;
  split.split = 12;
  const FilledMap parts = fill_map(make_synthetic_scene(small_orbit(12, true)), split);
  CHECK(tells(map_faults(parts.map), "keyframe ", "nothing that was measured joins it"));
}

}  // namespace hybrid_slam
