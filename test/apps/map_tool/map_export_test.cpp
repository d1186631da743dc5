// What is exported is read back to the same numbers.
#include "apps/map_tool/map_export.h"

#include <catch2/catch.hpp>

#include <cstdlib>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "apps/io/graphs/colmap.h"
#include "apps/io/graphs/graph_errors.h"
#include "apps/map_tool/image_names.h"
#include "apps/map_tool/map_residuals.h"
#include "backend/map/map_assembly.h"
#include "frontend/input/trajectory_file.h"
#include "test/apps/map_tool/tool_maps.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

FilledMap hybrid_map() {
  return map_of_frames(make_synthetic_scene(small_orbit(8, true)), 0, 16, 1);
}

void check_near(const Rigid3d& a, const Rigid3d& b, double tolerance) {
  const Rigid3d off = a * inverse(b);
  CHECK(off.translation().norm() < tolerance);
  CHECK(off.params.head<3>().norm() < tolerance);
}

// Landmarks by their exact position.
LandmarkId landmark_at(const MapSnapshot& map, const Eigen::Vector3d& point) {
  for (const LandmarkId id : map.landmark_ids()) {
    if (map.at(id).point_in_world == point) return id;
  }
  return {};
}

// Residuals that the model has to have: of a pair's left and right image each with its own v.
struct Expected {
  std::size_t observations = 0;
  double squares = 0;  // [px^2]
};

Expected expected_of(const MapSnapshot& map) {
  Expected expected;
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    for (std::uint32_t k = 0; k < keyframe.landmarks.size(); ++k) {
      if (!keyframe.landmarks[k].valid()) continue;
      const auto residual = residual_of(map, keyframe, k);
      if (!residual) continue;
      const Eigen::Vector3d& r = residual->pixels;
      if ((keyframe.cam_from_world * map.at(keyframe.landmarks[k]).point_in_world).z() <= 0)
        continue;
      expected.observations += residual->dimension == 3 ? 2 : 1;
      expected.squares += r.head<2>().squaredNorm();
      if (residual->dimension == 3) expected.squares += r[1] * r[1] + r[2] * r[2];
    }
  }
  return expected;
}

}  // namespace

TEST_CASE("a COLMAP model is read back to the same numbers") {
  const FilledMap filled = hybrid_map();
  const MapSnapshot& map = filled.map.view();
  const Expected expected = expected_of(map);
  const bool binary = GENERATE(false, true);
  const TempFolder folder;
  export_map(map,
             {binary ? ExportFormat::kColmapBinary : ExportFormat::kColmap, folder.path(), {}});
  const auto variant = binary ? ColmapVariant::kBinary : ColmapVariant::kText;
  const GraphFile read = read_colmap(folder.path(), variant);
  REQUIRE(read.graph.frames.size() == 24);  // 8 of each image
  CHECK(read.graph.cameras.size() == 3);
  CHECK(read.graph.points.size() <= map.landmark_count());
  REQUIRE(read.graph.observations.size() == expected.observations);
  double squares = 0;
  for (const GraphObservation& o : read.graph.observations) {
    const auto error = squared_error(read.graph, o);
    REQUIRE(error);
    squares += *error;
  }
  CHECK(squares == Approx(expected.squares).epsilon(1e-9));
  // The images of keyframe 0, a stereo pair: the right one is a baseline aside.
  const Rigid3d left = read.graph.frames[0].cam_from_world;
  const Rigid3d right = read.graph.frames[1].cam_from_world;
  check_near(left, map.at(KeyframeId(0)).cam_from_world, 1e-12);
  CHECK((right * inverse(left)).translation().x() ==
        Approx(-baseline(map.camera(CameraId(0)))).epsilon(1e-12));
  for (const auto& point : read.graph.points) CHECK(landmark_at(map, point.in_world).valid());

  const ColmapModel model =
      binary ? read_colmap_binary(folder.path()) : read_colmap_text(folder.path());
  REQUIRE(model.rigs.size() == 2);
  CHECK(model.rigs[0].others.size() == 1);
  CHECK(model.rigs[1].others.empty());
  CHECK(model.frames.size() == 16);
  CHECK(model.cameras[2].kind.name == "OPENCV_FISHEYE");
  CHECK(model.cameras[0].params[2] ==
        std::get<Calibrated<RectifiedStereo>>(map.camera(CameraId(0))).params[2] + 0.5);
  CHECK(model.images[0].name == "left/0000000000000000000.png");
  CHECK(model.images[1].name == "right/0000000000000000000.png");
}

TEST_CASE("trajectories are read back to the same numbers") {
  const FilledMap filled = hybrid_map();
  const MapSnapshot& map = filled.map.view();
  const auto [format, end] =
      GENERATE(table<ExportFormat, std::string>({{ExportFormat::kTum, ".tum"},
                                                 {ExportFormat::kKitti, ".txt"},
                                                 {ExportFormat::kEuroc, ".csv"}}));
  const TempFolder folder;
  export_map(map, {format, folder.path(), {}});
  for (const std::uint32_t camera : {0U, 1U}) {
    const std::string stem = camera == 0 ? "stereo" : "fisheye";
    const TrajectoryFile read = read_trajectory(folder.path() / (stem + end));
    CHECK(read.warnings.empty());
    REQUIRE(read.poses.size() == 8);
    std::ifstream times(folder.path() / (stem + "_times.txt"));
    std::size_t i = 0;
    for (const KeyframeId id : map.keyframe_ids()) {
      const Keyframe& keyframe = map.at(id);
      if (keyframe.observations->camera != CameraId(camera)) continue;
      check_near(read.poses[i].world_from_cam, inverse(keyframe.cam_from_world),
                 2e-8);  // 9 decimals, metres away
      double time = read.poses[i].time;
      if (format == ExportFormat::kKitti) times >> time;
      CHECK(time == Approx(keyframe.observations->time).margin(1e-9));
      ++i;
    }
  }
}

TEST_CASE("nerfstudio's cameras look along -z with y up") {
  const FilledMap filled = hybrid_map();
  const MapSnapshot& map = filled.map.view();
  const TempFolder folder;
  export_map(map, {ExportFormat::kNerfstudio, folder.path(), {}});
  std::ifstream file(folder.path() / "transforms.json");
  const auto json = nlohmann::json::parse(file);
  REQUIRE(json["frames"].size() == 16);
  CHECK(json["camera_model"] == "OPENCV");
  const auto& frame = json["frames"][2];  // the left image of the second moment
  CHECK(frame["file_path"] == "images/left/0000000000100000000.png");
  const Keyframe& keyframe = map.at(KeyframeId(2));
  const LandmarkId seen = *std::find_if(keyframe.landmarks.begin(), keyframe.landmarks.end(),
                                        [](LandmarkId id) { return id.valid(); });
  Eigen::Matrix4d world_from_gl;
  for (int i = 0; i < 16; ++i)
    world_from_gl(i / 4, i % 4) = frame["transform_matrix"][i / 4][i % 4];
  const Eigen::Vector3d in_gl =
      (world_from_gl.inverse() * map.at(seen).point_in_world.homogeneous()).head<3>();
  const double u = frame["fl_x"].get<double>() * in_gl.x() / -in_gl.z() + frame["cx"].get<double>();
  const double v =
      frame["fl_y"].get<double>() * -in_gl.y() / -in_gl.z() + frame["cy"].get<double>();
  const auto pixel =
      project(map.camera(keyframe), keyframe.cam_from_world * map.at(seen).point_in_world);
  REQUIRE(pixel);
  CHECK(u - 0.5 == Approx(pixel->x()).epsilon(1e-9));
  CHECK(v - 0.5 == Approx(pixel->y()).epsilon(1e-9));

  std::ifstream fish(folder.path() / "transforms_fisheye.json");
  const auto fisheye = nlohmann::json::parse(fish);
  CHECK(fisheye["camera_model"] == "OPENCV_FISHEYE");
  CHECK(fisheye["frames"].size() == 8);
  CHECK(fisheye["frames"][0]["k1"] ==
        std::get<Calibrated<KannalaBrandt>>(map.camera(CameraId(1))).params[4]);
}

TEST_CASE("a PLY holds a component's landmarks, then its keyframes") {
  const FilledMap filled = hybrid_map();
  const MapSnapshot& map = filled.map.view();
  const TempFolder folder;
  export_map(map, {ExportFormat::kPly, folder.path(), {}});
  const std::string text = read_text(folder.path() / "map.ply");
  const std::string end = "end_header\n";
  const std::size_t begin = text.find(end) + end.size();
  const std::size_t count = (text.size() - begin) / 15;
  CHECK(text.find("element vertex " + std::to_string(count) + "\n") != std::string::npos);
  CHECK(count == map.landmark_count() + map.keyframe_count());
  float first[3];
  std::copy_n(text.data() + begin, 12, reinterpret_cast<char*>(first));
  const LandmarkId by_stereo = map.landmark_ids().front();  // a pair made the first keyframe
  CHECK(first[0] == static_cast<float>(map.at(by_stereo).point_in_world.x()));
}

TEST_CASE("dives that begin again in time have files and names of their own") {
  const SyntheticScene scene = make_synthetic_scene(small_orbit(6, false));
  FilledMap a = map_of_frames(scene, 0, 6, 1);
  FilledMap b = map_of_frames(scene, 0, 5, 1);
  const MapPart parts[] = {{&a.map.view(), a.map.view().keyframe_ids(), {}},
                           {&b.map.view(), b.map.view().keyframe_ids(), {}}};
  const Map both = assemble_map(parts);
  const auto runs = runs_of(both.view());
  CHECK(runs.at(KeyframeId(5)) == 0);
  CHECK(runs.at(KeyframeId(6)) == 1);
  const ImageNames names(both.view(), {});
  CHECK(names.name(both.view().at(KeyframeId(6)), ImageSide::kRight) ==
        "run2/right/0000000000000000000.png");
  const TempFolder folder;
  export_map(both.view(), {ExportFormat::kTum, folder.path(), {}});
  CHECK(read_trajectory(folder.path() / "stereo.tum").poses.size() == 6);
  CHECK(read_trajectory(folder.path() / "component_6" / "stereo_run2.tum").poses.size() == 5);
}

TEST_CASE("images are named as the dataset names them", "[data]") {
  const char* const data = std::getenv("HYBRID_SLAM_DATA");
  if (data == nullptr) {
    std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
    return;
  }
  const FilledMap filled =
      map_of_frames(make_synthetic_scene(small_orbit(6, false)), 0, 6, 1);  // at 10 Hz, as KITTI's
  const MapSnapshot& map = filled.map.view();
  const std::string folder = std::string(data) + "/kitti";
  const ImageNames names(map, {folder});
  CHECK(names.name(map.at(KeyframeId(3)), ImageSide::kLeft) == "sequences/s1/image_0/000003.png");
  CHECK(names.name(map.at(KeyframeId(3)), ImageSide::kRight) == "sequences/s1/image_1/000003.png");
  CHECK(names.file(map.at(KeyframeId(3)), ImageSide::kRight) ==
        std::filesystem::path(folder) / "sequences/s1/image_1/000003.png");
  const TempFolder out;
  CHECK(names.write_rectified(out.path()) == 0);  // they are rectified
  // At another rate there is no image of the second keyframe's time.
  SyntheticSceneOptions faster = small_orbit(6, false);
  faster.frame_rate = 15;
  const FilledMap other = map_of_frames(make_synthetic_scene(faster), 0, 6, 1);
  CHECK_THROWS_WITH(ImageNames(other.map.view(), {folder}),
                    Catch::Contains("no image of time 0.066666667 s, of keyframe 1"));
}

TEST_CASE("an export that is refused leaves no folder behind") {
  FilledMap filled = map_of_frames(make_synthetic_scene(small_orbit(4, false)), 0, 4, 1);
  Calibrated<Bal> bal;
  bal.width = 640;
  bal.height = 480;
  bal.params = {500, 0, 0};
  filled.map.set_camera(CameraId(0), bal);
  const TempFolder folder;
  for (const ExportFormat format : {ExportFormat::kColmap, ExportFormat::kNerfstudio}) {
    const std::filesystem::path out = folder.path() / "out";
    CHECK_THROWS_AS(export_map(filled.map.view(), {format, out, {}}), InputError);
    CHECK_FALSE(std::filesystem::exists(out));
  }
}

}  // namespace hybrid_slam
