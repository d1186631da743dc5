#include "test/support/filled_map.h"

#include <numbers>

#include <catch2/catch.hpp>

#include "cameras/geometry/so3.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kLap = 12;

// A circle flown twice. The second time is another part of the map, turned, moved and 1.2 times as
// large.
struct TwoLaps {
  TwoLaps() {
    SyntheticSceneOptions options;
    options.times = 2 * kLap;
    options.step = 2 * std::numbers::pi * 3 / kLap;
    options.landmarks = 800;
    scene = make_synthetic_scene(options);
    FillOptions fill;
    fill.split = kLap;
    fill.split_drift = drift;
    filled = fill_map(scene, fill);
  }

  const MapSnapshot& map() const { return filled.map.view(); }

  const Sim3d drift{so3_exp({0.02, -0.05, 0.08}), {0.5, -0.3, 0.2}, 1.2};
  SyntheticScene scene;
  FilledMap filled;
};

TEST_CASE("A map may hold a place twice") {
  const TwoLaps laps;
  CHECK(laps.filled.map.check_consistency() == std::vector<std::string>{});
  int twice = 0;
  for (std::size_t i = 0; i < laps.scene.points_in_world.size(); ++i) {
    const LandmarkId first = laps.filled.first_landmarks[i];
    const LandmarkId second = laps.filled.landmarks[i];
    if (!first.valid() || !second.valid()) continue;
    ++twice;
    const Eigen::Vector3d& truth = laps.scene.points_in_world[i];
    CHECK((laps.map().at(first).point_in_world - truth).norm() < 1e-12);
    CHECK((laps.map().at(second).point_in_world - laps.drift * truth).norm() < 1e-12);
  }
  CHECK(twice > 600);
}

TEST_CASE("The parts of a map that holds a place twice share nothing but the tree") {
  const TwoLaps laps;
  for (std::size_t i = 0; i < laps.filled.keyframes.size(); ++i) {
    for (const Covisible& other : laps.map().at(laps.filled.keyframes[i]).covisible) {
      CHECK((other.id < laps.filled.keyframes[kLap]) == (i < kLap));
    }
  }
  CHECK(laps.map().at(laps.filled.keyframes[kLap]).parent == laps.filled.keyframes[kLap - 1]);
}

TEST_CASE("Each part of a map that holds a place twice is right in itself") {
  const TwoLaps laps;
  for (const KeyframeId id : laps.filled.keyframes) {
    const Keyframe& keyframe = laps.map().at(id);
    double worst = 0;
    for (std::size_t k = 0; k < keyframe.landmarks.size(); ++k) {
      if (!keyframe.landmarks[k].valid()) continue;
      const Keypoint& seen = keyframe.observations->features.keypoints[k];
      const Eigen::Vector3d& point = laps.map().at(keyframe.landmarks[k]).point_in_world;
      const auto pixel = project(laps.map().camera(keyframe), keyframe.cam_from_world * point);
      REQUIRE(pixel);
      worst = std::max(worst, (*pixel - Eigen::Vector2d(seen.x, seen.y)).norm() / seen.sigma);
    }
    CHECK(worst < 6);
  }
}

}  // namespace
}  // namespace hybrid_slam
