#include "apps/map_tool/map_info.h"

#include <catch2/catch.hpp>

#include <nlohmann/json.hpp>

#include "apps/map_tool/covered_area.h"
#include "backend/map/map_assembly.h"
#include "test/apps/map_tool/tool_maps.h"

namespace hybrid_slam {

TEST_CASE("area of a tilted patch of ground") {
  // 21 x 11 points, 5 cm apart: 1 m x 0.5 m, on a plane that leans.
  const Eigen::Quaterniond lean(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()));
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i <= 20; ++i) {
    for (int j = 0; j <= 10; ++j) points.push_back(lean * Eigen::Vector3d(0.05 * i, 0.05 * j, 3));
  }
  const CoveredArea area = covered_area(points, 0.1);
  CHECK(area.hull == Approx(0.5));
  CHECK(area.length == Approx(1));
  CHECK(area.width == Approx(0.5));
  CHECK(area.footprint > 0.5 * 0.9);
  CHECK(area.footprint < 0.5 * 1.5);  // cells at the rim lie half outside
  // A dent changes nothing of the hull, but leaves its cells empty.
  std::erase_if(points, [&](const Eigen::Vector3d& p) {
    return (lean.inverse() * p - Eigen::Vector3d(0.5, 0.25, 3)).norm() < 0.2;
  });
  const CoveredArea dented = covered_area(points, 0.1);
  CHECK(dented.hull == Approx(0.5));
  CHECK(dented.footprint < area.footprint - 0.04);
  CHECK(covered_area(std::span(points).first(2), 0.1).hull == 0);
}

TEST_CASE("info counts what is in a map and weighs its residuals") {
  const SyntheticScene scene = make_synthetic_scene(small_orbit(24, true));
  const FilledMap filled = map_of_frames(scene, 0, 48, 1);
  const MapSnapshot& map = filled.map.view();
  const MapInfo info = map_info(map, {"a program", "features: 7\n"});
  CHECK(info.keyframes == 48);
  REQUIRE(info.cameras.size() == 2);
  CHECK(info.cameras[0].keyframes == 24);
  CHECK(info.cameras[1].time.last - info.cameras[1].time.first == Approx(2.3));
  REQUIRE(info.components.size() == 1);
  CHECK(info.components[0].keyframes == std::vector<std::size_t>{24, 24});
  // 23 chords of a circle of 3 m radius, of which 24 make a lap.
  CHECK(info.components[0].way ==
        Approx(23 * 2 * 3 * std::sin(std::acos(-1.0) / 24)).epsilon(0.01));
  CHECK(info.edges.odometry == 46);
  CHECK(info.edges.loose == 0);
  CHECK(info.edges.returns > 0);  // the lap closes
  std::size_t observations = 0;
  for (const ResidualSummary& camera : {info.cameras[0].residuals, info.cameras[1].residuals}) {
    observations += camera.observations;
    CHECK(camera.behind == 0);
    // Poses are true and points nearly: the noise of the scene is what its sigmas say.
    CHECK(camera.rms > 0.9);
    CHECK(camera.median > 0.6);
  }
  CHECK(observations == info.observations);
  const auto json = to_json(info);
  CHECK(json["cameras"][0]["parameters"]["baseline"] == baseline(map.camera(CameraId(0))));
  CHECK(json["cameras"][0]["residuals"]["whitened_rms"] == info.cameras[0].residuals.rms);
  CHECK(json["components"][0]["name"] == 0);
  CHECK(json["options"] == "features: 7\n");
}

TEST_CASE("residuals with exact points are the noise that was made") {
  const SyntheticScene scene = make_synthetic_scene(small_orbit(12, false));
  FilledMap filled = map_of_frames(scene, 0, 12, 1);
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> points;
  const Rigid3d first = scene.frames.front().cam_from_world;
  for (std::size_t i = 0; i < filled.landmarks.size(); ++i) {
    if (!filled.landmarks[i].valid()) continue;
    points.emplace_back(filled.landmarks[i], first * scene.points_in_world[i]);
  }
  filled.map.move({}, points);
  const ResidualSummary residuals = residuals_by_camera(filled.map.view()).front();
  CHECK(residuals.observations > 2000);
  CHECK(residuals.rms == Approx(1).epsilon(0.03));
  CHECK(residuals.median == Approx(0.6745).epsilon(0.03));
}

}  // namespace hybrid_slam
