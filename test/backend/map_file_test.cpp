#include "backend/map/map_file.h"

#include <catch2/catch.hpp>

#include "cameras/files/output_file.h"
#include "test/backend/same_map.h"
#include "test/support/random_edits.h"
#include "test/support/temp_folder.h"
#include "test/support/test_cameras.h"

namespace hybrid_slam {
namespace {

const MapFileInfo kInfo{"a program 1.2", "features: 2000\nname: \"\xc3\xbc\"\n"};

FilledMap make_map(bool stereo, bool fisheye) {
  SyntheticSceneOptions options;
  options.times = 12;
  options.landmarks = 600;
  options.stereo = stereo;
  options.fisheye = fisheye;
  options.clutter = 30;
  FillOptions noise;
  noise.rotation_noise = 0.01;
  noise.translation_noise = 0.02;
  noise.point_noise = 0.05;
  noise.odometry = true;
  return fill_map(make_synthetic_scene(options), noise);
}

// What comes back is the map, and becomes the same bytes again.
LoadedMap check_round_trip(Map& map) {
  const TempFolder folder;
  save_map(folder.path() / "map", *map.snapshot(), kInfo);
  LoadedMap loaded = load_map(folder.path() / "map");
  CHECK(loaded.info.program == kInfo.program);
  CHECK(loaded.info.options == kInfo.options);
  CHECK(loaded.map.check_consistency() == std::vector<std::string>{});
  check_same_map(map.view(), loaded.map.view());
  save_map(folder.path() / "again", loaded.map.view(), loaded.info);
  CHECK(read_text(folder.path() / "map") == read_text(folder.path() / "again"));
  return loaded;
}

TEST_CASE("a saved map comes back bit by bit, whatever its cameras") {
  for (const auto& [stereo, fisheye] :
       {std::pair(true, false), std::pair(false, true), std::pair(true, true)}) {
    INFO("stereo " << stereo << ", fisheye " << fisheye);
    FilledMap filled = make_map(stereo, fisheye);
    CHECK(filled.map.view().keyframe_count() >= 12);
    CHECK(filled.map.view().landmark_count() > 300);
    check_round_trip(filled.map);
  }
}

TEST_CASE("an empty map comes back, with cameras and without") {
  Map map;
  check_round_trip(map);
  map.add_camera(synthetic_fisheye_camera());
  LoadedMap loaded = check_round_trip(map);
  CHECK(loaded.map.view().newest_frame_index(CameraId(0)) == -1);
  CHECK(loaded.map.add_camera(synthetic_stereo_camera(0.1)) == CameraId(1));
}

template <std::size_t... kModel>
void add_every_camera(Map& map, std::index_sequence<kModel...>) {
  (map.add_camera(TestCamera<typename std::variant_alternative_t<kModel, Camera>::Model>::camera()),
   ...);
}

TEST_CASE("every camera model comes back") {
  Map map;
  add_every_camera(map, std::make_index_sequence<std::variant_size_v<Camera>>());
  CHECK(check_round_trip(map).map.view().camera_count() == std::variant_size_v<Camera>);
}

TEST_CASE("a map continued from a load becomes the one that was never saved") {
  FilledMap filled = make_map(true, true);
  RandomEdits before(filled, 5);
  for (int i = 0; i < 1500; ++i) before.step();
  const std::size_t keyframes = filled.keyframes.size();
  CHECK(filled.map.view().keyframe_count() < keyframes);  // some were erased
  LoadedMap loaded = check_round_trip(filled.map);
  for (const KeyframeId id : filled.keyframes) {  // the erased ones, too
    CHECK(filled.map.view().cam_from_world(id).params ==
          loaded.map.view().cam_from_world(id).params);
  }
  FilledMap twin{std::move(loaded.map), filled.frames, filled.keyframes, filled.landmarks,
                 filled.first_landmarks};
  RandomEdits edits(filled, 11);
  RandomEdits same_edits(twin, 11);
  for (int i = 0; i < 1500; ++i) {
    edits.step();
    same_edits.step();
  }
  CHECK(filled.keyframes.size() > keyframes);
  CHECK(filled.keyframes == twin.keyframes);
  check_same_map(filled.map.view(), twin.map.view());
  CHECK(twin.map.check_consistency() == std::vector<std::string>{});
}

TEST_CASE("a map of many sections comes back") {
  SyntheticSceneOptions options;
  options.times = 40;
  options.clutter = 2000;
  FilledMap filled = fill_map(make_synthetic_scene(options), {});
  check_round_trip(filled.map);
}

TEST_CASE("frames that are all alike come back, though they compress beyond what is believed") {
  auto frame = std::make_shared<FrameObservations>();
  frame->camera = CameraId(0);
  frame->features.keypoints.resize(5000);
  frame->features.descriptors.resize(5000);
  Map map;
  map.add_camera(synthetic_fisheye_camera());
  for (int i = 0; i < 20; ++i) map.add_keyframe({frame, {}, {}, {}, map.view().origin()});
  check_round_trip(map);
}

// Made by map_optimizer of the last program that wrote version 2.
TEST_CASE(
    "a map file of version 2 is still read, and saved again it is one of the present version") {
  const std::filesystem::path path = std::filesystem::path(HYBRID_SLAM_MAPS) / "version_2.hslam";
  REQUIRE(read_text(path).substr(8, 1) == "\2");
  LoadedMap loaded = load_map(path);
  CHECK(loaded.info.program == "map_optimizer");
  const MapSnapshot& map = loaded.map.view();
  REQUIRE(map.keyframe_count() == 3);
  REQUIRE(map.landmark_count() == 12);
  std::size_t observations = 0;
  for (const LandmarkId id : map.landmark_ids()) observations += map.at(id).observations.size();
  CHECK(observations == 36);
  // The truth: 0.3 m to the right from keyframe to keyframe.
  const Rigid3d& last = map.at(KeyframeId(2)).cam_from_world;
  CHECK((inverse(last).translation() - Eigen::Vector3d(0.6, 0, 0)).norm() < 0.03);
  CHECK(map.at(KeyframeId(2)).odometry == nullptr);
  const TempFolder folder;
  save_map(folder.path() / "again", map, loaded.info);
  CHECK(read_text(folder.path() / "again").substr(8, 1) == "\5");
  check_same_map(map, load_map(folder.path() / "again").map.view());
}

// Made by hybrid_slam of the last program that wrote version 4, of three rendered pairs.
TEST_CASE("a map file of version 4 is still read: it says nothing of the rig") {
  const std::filesystem::path path = std::filesystem::path(HYBRID_SLAM_MAPS) / "version_4.hslam";
  REQUIRE(read_text(path).substr(8, 1) == "\4");
  LoadedMap loaded = load_map(path);
  const MapSnapshot& map = loaded.map.view();
  REQUIRE(map.keyframe_count() == 3);
  CHECK(map.landmark_count() == 64);
  CHECK(map.correction(CameraId(0)).empty());
  const TempFolder folder;
  save_map(folder.path() / "again", map, loaded.info);
  CHECK(read_text(folder.path() / "again").substr(8, 1) == "\5");
  check_same_map(map, load_map(folder.path() / "again").map.view());
}

TEST_CASE("what was found out about a stereo pair comes back, all of it or a part") {
  FilledMap filled = make_map(true, true);
  RigCorrection found;
  found.disparity = FoundParameter{1.25, 0.02, 0.2, 1.2};
  SECTION("the offset of its disparities") {}
  SECTION("everything") {
    found.rows = PairAlignment{3e-3, -2e-3, 5e-3, 412, 1.6, 0.3, 1e-5, 2e-5, 3e-5};
    found.shading = FoundParameter{-0.3, 0.1, 0, 0};
  }
  filled.map.set_correction(CameraId(0), found);
  CHECK(filled.map.view().correction(CameraId(1)).empty());
  const LoadedMap loaded = check_round_trip(filled.map);
  CHECK(loaded.map.view().correction(CameraId(0)) == found);
  CHECK(loaded.map.view().correction(CameraId(1)).empty());
}

// Made by hybrid_slam of the last program that wrote version 3, of two rendered pairs.
TEST_CASE("a map file of version 3 is still read: nothing was dropped in it") {
  const std::filesystem::path path = std::filesystem::path(HYBRID_SLAM_MAPS) / "version_3.hslam";
  REQUIRE(read_text(path).substr(8, 1) == "\3");
  LoadedMap loaded = load_map(path);
  const MapSnapshot& map = loaded.map.view();
  REQUIRE(map.keyframe_count() == 2);
  CHECK(map.landmark_count() == 52);
  const Keyframe& second = map.at(map.keyframe_ids().back());
  CHECK(second.observations->size() > 50);
  CHECK(second.observations->dropped == 0);
  REQUIRE(second.odometry != nullptr);
  CHECK(second.odometry->keypoints.size() > 5);
  CHECK(second.odometry->dropped == 0);
  const TempFolder folder;
  save_map(folder.path() / "again", map, loaded.info);
  CHECK(read_text(folder.path() / "again").substr(8, 1) == "\5");
  check_same_map(map, load_map(folder.path() / "again").map.view());
}

TEST_CASE("what cannot be written is an OutputError that leaves nothing behind") {
  const TempFolder folder;
  const FilledMap filled = make_map(true, false);
  const auto path = folder.path() / "missing" / "map";
  CHECK_THROWS_WITH(save_map(path, filled.map.view(), kInfo),
                    Catch::StartsWith(path.string() + ": cannot be written: "));
  CHECK_THROWS_AS(save_map(folder.path(), filled.map.view(), kInfo), OutputError);
  CHECK(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace hybrid_slam
