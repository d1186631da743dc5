#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace hybrid_slam {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// A rigid transform b_from_a: point_in_b = rotation * point_in_a + translation. Names carry both
// frames and cancel when composed: cam_from_world * world_from_rig.
// Memory, as handed to Ceres: 7 doubles, quaternion x y z w, then translation [m].
struct Rigid3d {
  Vector7d params{0, 0, 0, 1, 0, 0, 0};

  Rigid3d() = default;
  Rigid3d(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& translation) {
    this->rotation() = rotation.normalized();
    this->translation() = translation;
  }

  Eigen::Map<Eigen::Quaterniond> rotation() {
    return Eigen::Map<Eigen::Quaterniond>(params.data());
  }
  Eigen::Map<const Eigen::Quaterniond> rotation() const {
    return Eigen::Map<const Eigen::Quaterniond>(params.data());
  }
  Eigen::Map<Eigen::Vector3d> translation() {
    return Eigen::Map<Eigen::Vector3d>(params.data() + 4);
  }
  Eigen::Map<const Eigen::Vector3d> translation() const {
    return Eigen::Map<const Eigen::Vector3d>(params.data() + 4);
  }
};

inline Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a) {
  return {c_from_b.rotation() * b_from_a.rotation(),
          c_from_b.rotation() * b_from_a.translation() + c_from_b.translation()};
}

inline Eigen::Vector3d operator*(const Rigid3d& b_from_a, const Eigen::Vector3d& point_in_a) {
  return b_from_a.rotation() * point_in_a + b_from_a.translation();
}

inline Rigid3d inverse(const Rigid3d& b_from_a) {
  const Eigen::Quaterniond a_from_b_rotation = b_from_a.rotation().conjugate();
  return {a_from_b_rotation, -(a_from_b_rotation * b_from_a.translation())};
}

// The origin of frame b, in frame a.
inline Eigen::Vector3d origin_in_a(const Rigid3d& b_from_a) {
  return -(b_from_a.rotation().conjugate() * b_from_a.translation());
}

}  // namespace hybrid_slam
