#include "factors/manifolds.h"

#include "cameras/geometry/se3.h"
#include "cameras/geometry/sim3d.h"
#include "factors/transform_error.h"

namespace hybrid_slam {
namespace {

template <int kRows, int kCols>
bool write_identity(double* jacobian) {
  Eigen::Map<Eigen::Matrix<double, kRows, kCols, Eigen::RowMajor>>(jacobian).setIdentity();
  return true;
}

}  // namespace

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Rigid3d moved = se3_exp(Eigen::Map<const Vector6d>(delta)) * from_block<Rigid3d>(x);
  Eigen::Map<Vector7d>{x_plus_delta} = moved.params;
  return true;
}

bool PoseManifold::PlusJacobian(const double*, double* jacobian) const {
  return write_identity<7, 6>(jacobian);
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  Eigen::Map<Vector6d>{y_minus_x} =
      se3_log(from_block<Rigid3d>(y) * inverse(from_block<Rigid3d>(x)));
  return true;
}

bool PoseManifold::MinusJacobian(const double*, double* jacobian) const {
  return write_identity<6, 7>(jacobian);
}

bool Sim3Manifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Sim3d moved = sim3_exp(Eigen::Map<const Vector7d>(delta)) * from_block<Sim3d>(x);
  Eigen::Map<Vector8d>{x_plus_delta} = moved.params;
  return true;
}

bool Sim3Manifold::PlusJacobian(const double*, double* jacobian) const {
  return write_identity<8, 7>(jacobian);
}

bool Sim3Manifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  Eigen::Map<Vector7d>{y_minus_x} = sim3_log(from_block<Sim3d>(y) * inverse(from_block<Sim3d>(x)));
  return true;
}

bool Sim3Manifold::MinusJacobian(const double*, double* jacobian) const {
  return write_identity<7, 8>(jacobian);
}

}  // namespace hybrid_slam
