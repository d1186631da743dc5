#include "backend/map/disparity_shift.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "backend/backend.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

constexpr double kOffset = 3;  // [px]; disparities of this scene are some 100

double path_length(const MapSnapshot& map) {
  double length = 0;
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  for (const KeyframeId id : map.keyframe_ids()) {
    const Eigen::Vector3d place = inverse(map.at(id).cam_from_world).translation();
    length += (place - before).norm();
    before = place;
  }
  return length;
}

double median_disparity(const MapSnapshot& map) {
  std::vector<double> disparities;
  for (const KeyframeId id : map.keyframe_ids()) {
    const FrameObservations& seen = *map.at(id).observations;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      if (!seen.has_right(i)) continue;
      disparities.push_back(seen.features.keypoints[i].x - seen.u_right[i]);
    }
  }
  const auto middle = disparities.begin() + static_cast<std::ptrdiff_t>(disparities.size() / 2);
  std::nth_element(disparities.begin(), middle, disparities.end());
  return *middle;
}

FilledMap orbit() {
  return fill_map(make_synthetic_scene({.times = 15, .landmarks = 1200}), {.odometry = true});
}

TEST_CASE("another offset of the disparities holds for the whole map") {
  FilledMap filled = orbit();
  const double length = path_length(filled.map.view());
  const double disparity = median_disparity(filled.map.view());
  const double odometry =
      filled.map.view().at(filled.keyframes[3]).odometry->motion.b_from_a.translation().norm();
  const double scale = shift_disparities(filled.map, CameraId(0), kOffset);
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
  CHECK(median_disparity(filled.map.view()) == Approx(disparity + kOffset).epsilon(1e-4));
  CHECK(scale == Approx(disparity / (disparity + kOffset)).epsilon(0.01));
  CHECK(path_length(filled.map.view()) == Approx(scale * length).epsilon(1e-9));
  CHECK(filled.map.view().at(filled.keyframes[3]).odometry->motion.b_from_a.translation().norm() ==
        Approx(scale * odometry).epsilon(1e-9));
  CHECK(shift_disparities(filled.map, CameraId(0), -kOffset) == Approx(1 / scale).epsilon(1e-3));
  CHECK(path_length(filled.map.view()) == Approx(length).epsilon(1e-3));
}

TEST_CASE("keyframes of a pair as it was before keep their disparities") {
  FilledMap filled = orbit();
  const KeyframeId first = filled.keyframes[8];
  const auto right_of = [&](KeyframeId id) {
    return filled.map.view().at(id).observations->u_right;
  };
  const auto old = right_of(filled.keyframes[7]);
  const auto own = right_of(first);
  const double length = path_length(filled.map.view());
  CHECK(shift_disparities(filled.map, CameraId(0), kOffset, first) == 1);
  const auto same = right_of(filled.keyframes[7]);
  const auto shifted = right_of(first);
  for (std::size_t i = 0; i < old.size(); ++i) {
    CHECK((same[i] == old[i] || std::isnan(old[i])));
  }
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (!std::isnan(own[i])) CHECK(shifted[i] == Approx(own[i] - kOffset).epsilon(1e-5));
  }
  CHECK(path_length(filled.map.view()) == length);
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
}

TEST_CASE("a map that was made with a wrong offset becomes right once it is known") {
  FilledMap filled = orbit();
  const double length = path_length(filled.map.view());
  const KeyframeId newest = filled.keyframes.back();
  Backend backend(BackendOptions(), std::move(filled.map));
  backend.shift_disparities(CameraId(0), -kOffset);
  backend.optimize_full();
  const double wrong = path_length(backend.view()) / length;
  CHECK(wrong > 1.01);
  const std::size_t closings = backend.closings();
  const BundleResult of_the_wrong_map = solve_full(backend.view(), FullBundleOptions());
  backend.shift_disparities(CameraId(0), kOffset);
  CHECK(std::abs(path_length(backend.view()) / length - 1) < 0.2 * (wrong - 1));
  SECTION("adjusted by the smoother") {
    backend.optimize_local(newest);
    CHECK(std::abs(path_length(backend.view()) / length - 1) < 0.002);
  }
  SECTION("an adjustment that was begun before is no longer taken in") {
    const double before = path_length(backend.view());
    backend.take_in_full(of_the_wrong_map, closings);
    CHECK(path_length(backend.view()) == before);
  }
  CHECK(backend.map().check_consistency() == std::vector<std::string>{});
}

}  // namespace
}  // namespace hybrid_slam
