#pragma once

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

// Increments of a pose on the world's side: the estimate moves from cam_from_world to
// cam_from_world * exp(xi). Poses that move together, as one rigid body, have the same xi, and no
// term between them changes. So the derivatives of a term, wherever it is linearised, say exactly
// nothing about a common xi of its poses, and sums of terms that were linearised at different
// moments do not either (docs/backend.md).
//
// An increment is written as (way, turn) of what is at a place near the pose, along the world's
// axes. The place is a constant of each pose: it keeps numbers small far from the world's origin.
struct WorldTangent {
  Eigen::Vector3d place = Eigen::Vector3d::Zero();

  // xi of an increment.
  Vector6d at_origin(const Vector6d& increment) const {
    Vector6d xi = increment;
    xi.head<3>() += place.cross(increment.tail<3>());
    return xi;
  }

  // And back.
  Vector6d increment(const Vector6d& xi) const {
    Vector6d at_place = xi;
    at_place.head<3>() -= place.cross(xi.tail<3>());
    return at_place;
  }

  Rigid3d moved(const Rigid3d& cam_from_world, const Vector6d& increment) const;

  // Turns derivatives by xi into those by the increment, and back.
  template <typename Derived>
  auto from_origin(const Eigen::MatrixBase<Derived>& by_xi) const {
    return shifted(by_xi, place);
  }
  template <typename Derived>
  auto to_origin(const Eigen::MatrixBase<Derived>& by_increment) const {
    return shifted(by_increment, -place);
  }

  // Turns derivatives by a left perturbation, exp(d) * cam_from_world, into those by the increment.
  template <typename Derived>
  auto from_left(const Eigen::MatrixBase<Derived>& by_left, const Rigid3d& cam_from_world) const {
    return from_origin(by_left * adjoint(cam_from_world));
  }

  // How a point moves, to first order, that keeps its place before a camera with this increment.
  Eigen::Vector3d carried(const Eigen::Vector3d& point, const Vector6d& increment) const {
    return -increment.head<3>() - increment.tail<3>().cross(point - place);
  }

 private:
  template <typename Derived>
  static auto shifted(const Eigen::MatrixBase<Derived>& by, const Eigen::Vector3d& way) {
    Eigen::Matrix<double, Derived::RowsAtCompileTime, 6> result = by;
    result.template rightCols<3>() += by.template leftCols<3>() * hat(way);
    return result;
  }
};

}  // namespace hybrid_slam
