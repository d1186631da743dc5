#include "frontend/calibration/lens_error.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <utility>

#include "backend/backend.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kAll = 128;

// The scene as cameras see it whose lenses distort by `k` more than their calibration says.
void distort(SyntheticScene& scene, double k) {
  const auto& [fx, fy, cx, cy, baseline] =
      std::get<Calibrated<RectifiedStereo>>(scene.cameras.front()).params;
  for (SyntheticFrame& frame : scene.frames) {
    auto seen = std::make_shared<FrameObservations>(*frame.observations);
    for (std::size_t i = 0; i < seen->size(); ++i) {
      Keypoint& keypoint = seen->features.keypoints[i];
      const double u = (keypoint.x - cx) / fx, v = (keypoint.y - cy) / fy;
      const double u_right = (seen->u_right[i] - cx) / fx;
      keypoint.x += static_cast<float>(fx * k * (u * u + v * v) * u);
      keypoint.y += static_cast<float>(fy * k * (u * u + v * v) * v);
      seen->u_right[i] += static_cast<float>(fx * k * (u_right * u_right + v * v) * u_right);
    }
    frame.observations = std::move(seen);
  }
}

double way_of(const MapSnapshot& map) {
  double length = 0;
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  for (const KeyframeId id : map.keyframe_ids()) {
    const Eigen::Vector3d place = inverse(map.at(id).cam_from_world).translation();
    length += (place - before).norm();
    before = place;
  }
  return length;
}

struct Adjusted {
  double true_way = 0, way = 0;
  std::optional<LensError> found;
};

Adjusted adjusted(double k, std::uint64_t seed) {
  SyntheticScene scene =
      make_synthetic_scene({.times = 30, .landmarks = 1500, .noise = 0.1, .seed = seed});
  distort(scene, k);
  FilledMap filled = fill_map(scene, {});
  Adjusted result;
  result.true_way = way_of(filled.map.view());
  Backend backend(BackendOptions(), std::move(filled.map));
  backend.optimize_full();
  result.way = way_of(backend.view());
  result.found = find_lens_error(backend.view(), CameraId(0), kAll);
  return result;
}

TEST_CASE("a distortion that was left in is found, and what it does to the scale", "[lens_error]") {
  for (const double k : {-0.008, 0.008}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      const Adjusted one = adjusted(k, seed);
      REQUIRE(one.found);
      CAPTURE(k, seed, one.way / one.true_way, one.found->scale, one.found->distortion,
              one.found->sigma);
      CHECK(one.found->is_shown());
      CHECK(one.found->sigma < 1e-3);
      // Not all of it: what contradicts most, the adjustment has taken for outliers.
      const double share = one.found->distortion / k;
      const double share_of_scale = (one.found->scale - 1) / (one.way / one.true_way - 1);
      CHECK((share > 0.75 && share < 1 + 4 * one.found->sigma / std::abs(k)));
      CHECK((share_of_scale > 0.75 && share_of_scale < 1 + 4 * one.found->sigma / std::abs(k)));
    }
  }
}

TEST_CASE("right lenses are left alone", "[lens_error]") {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const Adjusted one = adjusted(0, seed);
    REQUIRE(one.found);
    CHECK(std::abs(one.found->distortion) < 4 * one.found->sigma);
    CHECK_FALSE(one.found->is_shown());
  }
}

TEST_CASE("a map that tells nothing of the lenses", "[lens_error]") {
  FilledMap one = fill_map(make_synthetic_scene({.times = 1}), {});
  CHECK_FALSE(find_lens_error(one.map.view(), CameraId(0), kAll));
  FilledMap fisheye =
      fill_map(make_synthetic_scene({.times = 5, .stereo = false, .fisheye = true}), {});
  CHECK_FALSE(find_lens_error(fisheye.map.view(), CameraId(0), kAll));
}

}  // namespace
}  // namespace hybrid_slam
