#pragma once

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam::pose_scene {

// Reproducible numbers for the tests of pose estimation.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  double normal() {  // Box and Muller
    const double radius = std::sqrt(-2 * std::log(uniform(1e-300, 1)));
    return radius * std::cos(uniform(0, 2 * std::numbers::pi));
  }
  Eigen::Vector3d vector(double low, double high) {
    const double x = uniform(low, high), y = uniform(low, high), z = uniform(low, high);
    return {x, y, z};
  }
  Eigen::Vector3d unit() {
    const double x = normal(), y = normal(), z = normal();
    return Eigen::Vector3d(x, y, z).normalized();
  }
  // Turned by up to `angle` [rad] about any axis, moved by up to `distance` [m] along each axis.
  Rigid3d pose(double angle, double distance) {
    const Eigen::AngleAxisd rotation(uniform(0, angle), unit());
    return {Eigen::Quaterniond(rotation), vector(-distance, distance)};
  }

 private:
  std::mt19937_64 engine_;
};

inline Calibrated<Pinhole> pinhole() { return {{500, 510, 320, 240}, 640, 480}; }
inline Calibrated<RectifiedStereo> stereo() { return {{700, 705, 600, 180, 0.5}, 1226, 370}; }
inline Calibrated<KannalaBrandt> fisheye() {
  return {{300, 302, 512, 510, -0.01, 0.005, -0.002, 0.0003}, 1024, 1024};
}

// Angle between two rotations [rad] and distance between two origins [m].
inline double rotation_error(const Rigid3d& a, const Rigid3d& b) {
  return Eigen::Quaterniond(a.rotation()).angularDistance(Eigen::Quaterniond(b.rotation()));
}
inline double translation_error(const Rigid3d& a, const Rigid3d& b) {
  return (origin_in_a(a) - origin_in_a(b)).norm();
}

}  // namespace hybrid_slam::pose_scene
