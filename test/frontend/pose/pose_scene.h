#pragma once

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam::pose_scene {

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
