#include "backend/incremental/block.h"

#include <ceres/manifold.h>

#include "cameras/geometry/so3.h"

namespace hybrid_slam {

namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Eigen::MatrixXd plus_jacobian(const ceres::Manifold& manifold, const Eigen::VectorXd& at) {
  RowMajor jacobian(manifold.AmbientSize(), manifold.TangentSize());
  manifold.PlusJacobian(at.data(), jacobian.data());
  return jacobian;
}

Eigen::MatrixXd minus_jacobian(const ceres::Manifold& manifold, const Eigen::VectorXd& at) {
  RowMajor jacobian(manifold.TangentSize(), manifold.AmbientSize());
  manifold.MinusJacobian(at.data(), jacobian.data());
  return jacobian;
}

}  // namespace

Block::Block(const GraphBlock& block, const Eigen::Matrix3d& rotation)
    : given(block), inner(block.values) {
  for (const int start : given.world_vectors) {
    inner.segment<3>(start) = rotation * given.values.segment<3>(start);
  }
  if (given.manifold != nullptr) basis = plus_jacobian(*given.manifold, inner);
  folded_delta =
      Eigen::VectorXd::Zero(given.manifold != nullptr ? basis.cols() : given.values.size());
}

Eigen::VectorXd Block::moved(const Eigen::VectorXd& increment) const {
  if (given.manifold == nullptr) return inner + increment;
  const Eigen::VectorXd tangent = minus_jacobian(*given.manifold, inner) * (basis * increment);
  Eigen::VectorXd result(inner.size());
  given.manifold->Plus(inner.data(), tangent.data(), result.data());
  return result;
}

void Block::fold(const Eigen::VectorXd& delta) {
  inner = inner_at(delta);
  folded_delta = delta;
  if (given.manifold == nullptr) return;
  const Eigen::MatrixXd projected =
      plus_jacobian(*given.manifold, inner) * (minus_jacobian(*given.manifold, inner) * basis);
  for (Eigen::Index i = 0; i < basis.cols(); ++i) {
    basis.col(i) = projected.col(i) * (basis.col(i).norm() / projected.col(i).norm());
  }
}

Eigen::VectorXd Block::in_world(Eigen::VectorXd values, const Eigen::Matrix3d& rotation) const {
  for (const int start : given.world_vectors) {
    values.segment<3>(start) = (rotation.transpose() * values.segment<3>(start)).eval();
  }
  return values;
}

Eigen::MatrixXd Block::by_increment(const Eigen::MatrixXd& by_world,
                                    const Eigen::Matrix3d& rotation) const {
  Eigen::MatrixXd result = by_world;
  for (const int start : given.world_vectors) {
    result.middleCols<3>(start) = by_world.middleCols<3>(start) * rotation.transpose();
  }
  return basis.size() == 0 ? result : Eigen::MatrixXd(result * basis);
}

// With v = R^T inner and R <- R exp(turn): v <- v - turn x v.
Eigen::Matrix<double, Eigen::Dynamic, 3> Block::by_turn(const Eigen::MatrixXd& by_world,
                                                        const Eigen::VectorXd& in_world) const {
  Eigen::Matrix<double, Eigen::Dynamic, 3> result =
      Eigen::Matrix<double, Eigen::Dynamic, 3>::Zero(by_world.rows(), 3);
  for (const int start : given.world_vectors) {
    result.noalias() +=
        by_world.middleCols<3>(start) * hat(Eigen::Vector3d(in_world.segment<3>(start)));
  }
  return result;
}

}  // namespace hybrid_slam
