#pragma once

#include <type_traits>
#include <vector>

#include "cameras/camera.h"
#include "test/support/random.h"

namespace hybrid_slam {

// Example calibrations and points that they can see: the common ground of the tests of models and
// factors. Points cover the image, its border and corners, the surroundings of the optical axis
// (exactly on it included) and, for the fisheye, rays beyond 90 degrees.
template <ProjectionModel M>
struct TestCamera;

template <>
struct TestCamera<Pinhole> {
  static Calibrated<Pinhole> camera() { return {{868.4, 871.2, 506.3, 391.7}, 1024, 768}; }
};

template <>
struct TestCamera<RectifiedStereo> {
  static Calibrated<RectifiedStereo> camera() {
    return {{868.4, 868.4, 506.3, 391.7, 0.15}, 1024, 768};
  }
};

template <>
struct TestCamera<LeftOfStereo> {
  static Calibrated<LeftOfStereo> camera() {
    return {TestCamera<RectifiedStereo>::camera().params, 1024, 768};
  }
};

template <>
struct TestCamera<KannalaBrandt> {
  static Calibrated<KannalaBrandt> camera() {
    return {{302.7, 302.4, 514.9, 508.3, -0.0184, 0.0117, -0.0093, 0.0021}, 1024, 1024};
  }
};

template <>
struct TestCamera<Radial> {
  static Calibrated<Radial> camera() { return {{712.4, 506.3, 391.7, -0.087, 0.023}, 1024, 768}; }
};

// From the lower left corner of an image of this size upwards, as Bal counts from the centre.
template <>
struct TestCamera<Bal> {
  static Calibrated<Bal> camera() { return {{712.4, -0.087, 0.023}, 512, 384}; }
};

// The sign of z in front of the camera.
template <ProjectionModel M>
inline constexpr double kAhead = std::is_same_v<M, Bal> ? -1 : 1;

template <ProjectionModel M>
std::vector<Eigen::Vector3d> test_points(Random& random) {
  const Calibrated<M> camera = TestCamera<M>::camera();
  const double w = camera.width;
  const double h = camera.height;
  std::vector<Eigen::Vector3d> points;
  const auto add_pixel = [&](double u, double v) {
    const double pixel[2] = {u, v};
    Eigen::Vector3d bearing;
    if (M::unproject(camera.params.data(), pixel, bearing.data())) {
      points.push_back(random.uniform(0.3, 20) * bearing);
    }
  };
  for (const double u : {-0.5, w / 2, w - 0.5}) {
    for (const double v : {-0.5, h / 2, h - 0.5}) add_pixel(u, v);
  }
  for (int i = 0; i < 50; ++i) add_pixel(random.uniform(0, w), random.uniform(0, h));
  points.emplace_back(0, 0, 2 * kAhead<M>);
  for (const double tilt : {1e-12, 1e-9, 1e-6, 1e-4, 0.0099, 0.0101, 0.02}) {
    points.push_back(3 * Eigen::Vector3d(tilt * 0.6, -tilt * 0.8, kAhead<M>));
  }
  if constexpr (std::is_same_v<M, KannalaBrandt>) {
    const double limit = M::max_angle(camera.params.data());
    for (const double angle : {1.55, 1.5707963267948966, 1.59, 1.7, 0.95 * limit}) {
      const double azimuth = random.uniform(0, 6.28);
      points.push_back(random.uniform(0.3, 20) *
                       Eigen::Vector3d(std::sin(angle) * std::cos(azimuth),
                                       std::sin(angle) * std::sin(azimuth), std::cos(angle)));
    }
  }
  return points;
}

}  // namespace hybrid_slam
