// Parts of maps, and maps side by side.
#include "backend/map/map_assembly.h"

#include <catch2/catch.hpp>

#include "apps/map_tool/map_crop.h"
#include "backend/map/components.h"
#include "backend/map/odometry.h"
#include "cameras/files/input_error.h"
#include "test/apps/map_tool/tool_maps.h"

namespace hybrid_slam {
namespace {

Map cropped(const MapSnapshot& map, const CropOptions& options) {
  Map result = crop_map(map, options);
  CHECK(result.check_consistency().empty());
  return result;
}

}  // namespace

TEST_CASE("a part of a map holds what its keyframes measured, as it was") {
  const SyntheticScene scene = make_synthetic_scene(small_orbit(16, true));
  const FilledMap filled = map_of_frames(scene, 0, 32, 1);
  const MapSnapshot& map = filled.map.view();
  CropOptions options;
  options.from = scene.frames[8].observations->time;
  options.to = scene.frames[20].observations->time;
  const Map part = cropped(map, options);
  std::vector<KeyframeId> wanted;
  for (const KeyframeId id : map.keyframe_ids()) {
    const double time = map.at(id).observations->time;
    if (time >= options.from && time <= options.to) wanted.push_back(id);
  }
  REQUIRE(part.view().keyframe_count() == wanted.size());
  REQUIRE(wanted.size() == 14);  // frames 8 to 21: two cameras at each of seven times
  std::size_t observed = 0;
  for (std::uint32_t i = 0; i < wanted.size(); ++i) {
    const Keyframe& now = part.view().at(KeyframeId(i));
    const Keyframe& before = map.at(wanted[i]);
    CHECK(now.observations == before.observations);
    CHECK(now.cam_from_world.params == before.cam_from_world.params);
    for (std::size_t k = 0; k < now.landmarks.size(); ++k) {
      if (!now.landmarks[k].valid()) continue;
      ++observed;
      CHECK(part.view().at(now.landmarks[k]).point_in_world ==
            map.at(before.landmarks[k]).point_in_world);
    }
  }
  // All that two of them see, or one in stereo.
  std::size_t expected = 0;
  for (const LandmarkId id : map.landmark_ids()) {
    std::size_t seen = 0;
    bool stereo = false;
    for (const Observation& o : map.at(id).observations) {
      if (!std::binary_search(wanted.begin(), wanted.end(), o.keyframe)) continue;
      ++seen;
      stereo = stereo || map.at(o.keyframe).observations->has_right(o.keypoint);
    }
    if (seen > 1 || stereo) expected += seen;
  }
  CHECK(observed == expected);
  CHECK(component_sizes(part.view()).size() == 1);
}

TEST_CASE("odometry goes on over keyframes that are left out") {
  const SyntheticScene scene = make_synthetic_scene(small_orbit(12, false));
  const FilledMap filled = map_of_frames(scene, 0, 12, 1);
  const MapSnapshot& map = filled.map.view();
  MapPart part;
  part.map = &map;
  part.keyframes = {KeyframeId(0), KeyframeId(1), KeyframeId(5)};
  const Map made = assemble_map({&part, 1});
  CHECK(made.check_consistency().empty());
  const auto& odometry = made.view().at(KeyframeId(2)).odometry;
  REQUIRE(odometry != nullptr);
  CHECK(odometry->previous == KeyframeId(1));
  const Rigid3d expected =
      map.at(KeyframeId(5)).cam_from_world * inverse(map.at(KeyframeId(1)).cam_from_world);
  const Rigid3d off = odometry->motion.b_from_a * inverse(expected);
  CHECK(off.translation().norm() < 1e-9);
  CHECK(off.params.head<3>().norm() < 1e-9);
  // Four motions, each of a covariance of its own, are less certain than the last one.
  const Matrix6d& sum = odometry->motion.covariance;
  CHECK(sum.trace() > 3.9 * map.at(KeyframeId(5)).odometry->motion.covariance.trace());
  CHECK(!is_loose(*odometry));
}

TEST_CASE("a box leaves the landmarks in it and the keyframes that see them") {
  const FilledMap filled = map_of_frames(make_synthetic_scene(small_orbit(24, false)), 0, 24, 1);
  const MapSnapshot& map = filled.map.view();
  CropOptions options;
  const Eigen::Vector3d ground = map.at(map.landmark_ids().front()).point_in_world;
  options.box = Eigen::AlignedBox3d(ground - Eigen::Vector3d::Constant(1),
                                    ground + Eigen::Vector3d::Constant(1));
  const Map part = cropped(map, options);
  std::size_t inside = 0;
  for (const LandmarkId id : map.landmark_ids()) {
    inside += options.box->contains(map.at(id).point_in_world) ? 1 : 0;
  }
  CHECK(static_cast<double>(part.view().landmark_count()) > 0.8 * static_cast<double>(inside));
  CHECK(part.view().landmark_count() <= inside);
  CHECK(part.view().keyframe_count() < map.keyframe_count());
  for (const LandmarkId id : part.view().landmark_ids()) {
    CHECK(options.box->contains(part.view().at(id).point_in_world));
  }
}

TEST_CASE("maps side by side are components, with frames counted on") {
  const SyntheticScene scene = make_synthetic_scene(small_orbit(10, true));
  FilledMap a = map_of_frames(scene, 0, 12, 1);
  FilledMap b = map_of_frames(scene, 0, 20, 1);
  const MapPart parts[] = {{&a.map.view(), a.map.view().keyframe_ids(), {}},
                           {&b.map.view(), b.map.view().keyframe_ids(), {}}};
  const Map made = assemble_map(parts);
  CHECK(made.check_consistency().empty());
  const MapSnapshot& map = made.view();
  CHECK(map.camera_count() == 2);
  CHECK(component_sizes(map) ==
        std::map<KeyframeId, std::size_t>{{KeyframeId(0), 12}, {KeyframeId(12), 20}});
  CHECK(map.landmark_count() == a.map.view().landmark_count() + b.map.view().landmark_count());
  // The first map's last moment is number 5, the second's begins at number 0.
  CHECK(map.at(KeyframeId(11)).observations->frame_index == 5);
  CHECK(map.at(KeyframeId(12)).observations->frame_index == 6);
  REQUIRE(map.at(KeyframeId(12)).odometry != nullptr);
  CHECK(is_loose(*map.at(KeyframeId(12)).odometry));
  CHECK(map.at(KeyframeId(12)).keep);

  CropOptions second;
  second.component = KeyframeId(12);
  CHECK(crop_map(map, second).view().keyframe_count() == 20);
  second.component = KeyframeId(3);
  CHECK_THROWS_WITH(crop_map(map, second), "no component 3: there are 0, 12");
  CropOptions never;
  never.from = 1e6;
  CHECK_THROWS_AS(crop_map(map, never), InputError);
}

}  // namespace hybrid_slam
