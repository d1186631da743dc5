#pragma once

#include <memory>

#include <ceres/autodiff_cost_function.h>

#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// Factors that know no derivatives of their own. A pose is cam_from_world: quaternion x y z w, then
// translation.

template <typename T>
using Vector3 = Eigen::Matrix<T, 3, 1>;

template <typename T>
Vector3<T> centre_of(const T* pose) {
  const Eigen::Map<const Eigen::Quaternion<T>> rotation(pose);
  return -(rotation.conjugate() * Eigen::Map<const Vector3<T>>(pose + 4));
}

// The distance between a camera and a beacon, a block of three.
struct RangeError {
  double range;
  double sigma;
  template <typename T>
  bool operator()(const T* pose, const T* beacon, T* residual) const {
    residual[0] = ((centre_of(pose) - Eigen::Map<const Vector3<T>>(beacon)).norm() - range) / sigma;
    return true;
  }
};

inline std::shared_ptr<const ceres::CostFunction> range_factor(double range, double sigma) {
  return std::make_shared<ceres::AutoDiffCostFunction<RangeError, 1, 7, 3>>(
      new RangeError{range, sigma});
}

// What an inertial sensor says, simplified, without gravity: blocks (velocity in the world, bias of
// the turn rate, bias of the acceleration) of two poses `dt` apart.
struct InertialError {
  double dt = 0.1;
  Eigen::Quaterniond b_from_a;   // measured, with the bias
  Eigen::Vector3d acceleration;  // in a, with the bias
  double sigma_place = 0.01;
  double sigma_velocity = 0.02;
  double sigma_turn = 0.002;
  double sigma_bias = 0.001;

  template <typename T>
  bool operator()(const T* a, const T* b, const T* block_a, const T* block_b, T* residual) const {
    using Quaternion = Eigen::Quaternion<T>;
    const Eigen::Map<const Quaternion> q_a(a);
    const Eigen::Map<const Quaternion> q_b(b);
    const Eigen::Map<const Eigen::Matrix<T, 9, 1>> x_a(block_a);
    const Eigen::Map<const Eigen::Matrix<T, 9, 1>> x_b(block_b);
    Eigen::Map<Eigen::Matrix<T, 15, 1>> r(residual);
    const T step(dt);
    const Vector3<T> v_a = x_a.template head<3>();
    const Vector3<T> v_b = x_b.template head<3>();
    r.template segment<3>(0) = (centre_of(b) - centre_of(a) - v_a * step) / T(sigma_place);
    const Vector3<T> pull = acceleration.cast<T>() - x_a.template tail<3>();
    r.template segment<3>(3) = (v_b - v_a - (q_a.conjugate() * pull) * step) / T(sigma_velocity);
    const Quaternion error = b_from_a.cast<T>().conjugate() * (q_b * q_a.conjugate());
    const Vector3<T> turn = T(2) * error.vec() - x_a.template segment<3>(3) * step;
    r.template segment<3>(6) = turn / T(sigma_turn);
    r.template segment<6>(9) = (x_b.template tail<6>() - x_a.template tail<6>()) / T(sigma_bias);
    return true;
  }
};

inline std::shared_ptr<const ceres::CostFunction> inertial_factor(const InertialError& error) {
  return std::make_shared<ceres::AutoDiffCostFunction<InertialError, 15, 7, 7, 9, 9>>(
      new InertialError(error));
}

// A direction of the world, seen by a camera.
struct DirectionError {
  Eigen::Vector3d in_cam;
  double sigma;
  template <typename T>
  bool operator()(const T* pose, const T* direction, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(pose);
    const Vector3<T> seen = rotation * Vector3<T>(Eigen::Map<const Vector3<T>>(direction));
    Eigen::Map<Vector3<T>>{residual} = (seen - in_cam.cast<T>()) / T(sigma);
    return true;
  }
};

inline std::shared_ptr<const ceres::CostFunction> direction_factor(const Eigen::Vector3d& in_cam,
                                                                   double sigma) {
  return std::make_shared<ceres::AutoDiffCostFunction<DirectionError, 3, 7, 3>>(
      new DirectionError{in_cam, sigma});
}

// A value that is known: (block - value) / sigma.
template <int kSize>
struct ValueError {
  Eigen::Matrix<double, kSize, 1> value;
  double sigma;
  template <typename T>
  bool operator()(const T* block, T* residual) const {
    using Vector = Eigen::Matrix<T, kSize, 1>;
    Eigen::Map<Vector>{residual} =
        (Eigen::Map<const Vector>(block) - value.template cast<T>()) / T(sigma);
    return true;
  }
};

template <int kSize>
std::shared_ptr<const ceres::CostFunction> value_factor(
    const Eigen::Matrix<double, kSize, 1>& value, double sigma) {
  return std::make_shared<ceres::AutoDiffCostFunction<ValueError<kSize>, kSize, kSize>>(
      new ValueError<kSize>{value, sigma});
}

}  // namespace hybrid_slam
