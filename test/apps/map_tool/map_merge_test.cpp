#include "apps/map_tool/map_merge.h"

#include <catch2/catch.hpp>

#include "apps/map_tool/place_agreement.h"
#include "backend/map/components.h"
#include "backend/map/map_assembly.h"
#include "cameras/geometry/se3.h"
#include "test/apps/map_tool/tool_maps.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"

namespace hybrid_slam {
namespace {

const MergeOptions kOptions;

Rigid3d somewhere() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(1.2, Eigen::Vector3d(1, -1, 2).normalized())),
          Eigen::Vector3d(40, -7, 3)};
}

SyntheticSceneOptions ground(std::uint64_t seed) {
  SyntheticSceneOptions options = small_orbit(60, false);
  options.landmarks = 3000;
  options.seed = seed;
  return options;
}

// Camera centres of the merged map against the truth, worst [m]. The first map's keyframe 0 is at
// frame 0, where the world begins.
double worst_error(const MapSnapshot& map, const SyntheticScene& scene,
                   const std::vector<std::size_t>& frames) {
  double worst = 0;
  for (std::uint32_t i = 0; i < frames.size(); ++i) {
    const Rigid3d& truth = scene.frames[frames[i]].cam_from_world;
    worst = std::max(
        worst, (origin_in_a(map.at(KeyframeId(i)).cam_from_world) - origin_in_a(truth)).norm());
  }
  return worst;
}

LoopMeasurement place(const MapSnapshot& map, KeyframeId keyframe, KeyframeId match,
                      const Rigid3d& other_world_from_world) {
  LoopMeasurement loop;
  loop.keyframe = keyframe;
  loop.match = match;
  loop.keyframe_from_match = Sim3d(map.at(keyframe).cam_from_world * other_world_from_world *
                                   inverse(map.at(match).cam_from_world));
  return loop;
}

}  // namespace

TEST_CASE("two dives over one ground become one component", "[merge]") {
  const SyntheticScene scene = make_synthetic_scene(ground(1));
  // Frames 0, 2, ... 38 and 61 - 40 = 21, 23, ... 59: half of each is common ground.
  FilledMap a = map_of_frames(scene, 0, 40, 2);
  FilledMap b = map_of_frames(scene, 21, 60, 2);
  move_world(b.map, somewhere());
  const MapSnapshot* const maps[] = {&a.map.view(), &b.map.view()};
  const MergeResult result = merge_maps(maps, scene_vocabulary(scene), kOptions);
  CHECK(result.map.check_consistency().empty());
  CHECK(result.summary.components == 1);
  CHECK(component_sizes(result.map.view()).size() == 1);
  CHECK(result.summary.joins == 1);
  CHECK(result.summary.fused > 200);
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < 40; i += 2) frames.push_back(i);
  for (std::size_t i = 21; i < 60; i += 2) frames.push_back(i);
  REQUIRE(result.map.view().keyframe_count() == frames.size());
  CHECK(worst_error(result.map.view(), scene, frames) < 0.03);  // 3 m above the ground
  // The inputs are as they were.
  CHECK(a.map.view().keyframe_count() == 20);
}

TEST_CASE("dives over other grounds stay apart, as they were", "[merge]") {
  const SyntheticScene scene = make_synthetic_scene(ground(1));
  const SyntheticScene other = make_synthetic_scene(ground(2));
  FilledMap a = map_of_frames(scene, 0, 20, 2);
  FilledMap b = map_of_frames(other, 0, 20, 2);
  const MapSnapshot* const maps[] = {&a.map.view(), &b.map.view()};
  const MergeResult result = merge_maps(maps, scene_vocabulary(scene), kOptions);
  CHECK(result.map.check_consistency().empty());
  CHECK(result.summary.components == 2);
  CHECK(result.summary.joins == 0);
  CHECK(result.summary.closed == 0);
  CHECK(component_sizes(result.map.view()) ==
        std::map<KeyframeId, std::size_t>{{KeyframeId(0), 10}, {KeyframeId(10), 10}});
  CHECK(result.summary.inputs[1].component == KeyframeId(10));
}

TEST_CASE("places agree within the drift between them", "[merge]") {
  const SyntheticScene scene = make_synthetic_scene(ground(1));
  FilledMap a = map_of_frames(scene, 0, 30, 2);
  FilledMap b = map_of_frames(scene, 1, 30, 2);
  move_world(b.map, somewhere());
  const MapPart parts[] = {{&a.map.view(), a.map.view().keyframe_ids(), {}},
                           {&b.map.view(), b.map.view().keyframe_ids(), {}}};
  const Map both = assemble_map(parts);
  const MapSnapshot& map = both.view();
  const LoopClosureOptions options;
  const LoopMeasurement first = place(map, KeyframeId(15), KeyframeId(0), somewhere());
  const KeyframeId newer(27);
  const KeyframeId older(12);
  CHECK(places_agree(map, first, place(map, newer, older, somewhere()), options));
  // The way is a good 7 m: 5 % of it, twice, are half a metre.
  const auto aside = [&](double metres, double radians) {
    Vector6d off = Vector6d::Zero();
    off[0] = metres;
    off[5] = radians;
    LoopMeasurement loop = place(map, newer, older, somewhere());
    loop.keyframe_from_match = Sim3d(se3_exp(off)) * loop.keyframe_from_match;
    return loop;
  };
  CHECK(places_agree(map, first, aside(0.3, 0), options));
  CHECK(!places_agree(map, first, aside(4, 0), options));
  CHECK(places_agree(map, first, aside(0, 0.02), options));
  CHECK(!places_agree(map, first, aside(0, 0.3), options));
  // A place that is named from the other side says the same.
  LoopMeasurement swapped = place(map, newer, older, somewhere());
  std::swap(swapped.keyframe, swapped.match);
  swapped.keyframe_from_match = inverse(swapped.keyframe_from_match);
  CHECK(places_agree(map, first, swapped, options));

  LoopMeasurement shows = first;
  for (std::uint32_t i = 0; i < 5; ++i) shows.same.push_back({LandmarkId(i), LandmarkId(100 + i)});
  LoopMeasurement more = shows;
  more.new_observations.push_back({LandmarkId(7), {newer, 0}});
  CHECK(landmarks_of_its_own(more, shows) == 1);
  CHECK(landmarks_of_its_own(shows, more) == 0);
}

}  // namespace hybrid_slam
