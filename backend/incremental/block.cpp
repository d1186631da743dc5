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

void Block::write(const Eigen::Map<const Eigen::VectorXd>& delta, const Eigen::Matrix3d& rotation,
                  double* to) const {
  Eigen::Map<Eigen::VectorXd> values(to, inner.size());
  values = inner;
  if (delta != folded_delta) {
    if (given.manifold == nullptr) {
      values += delta - folded_delta;
    } else {
      values = moved(delta - folded_delta);
    }
  }
  for (const int start : given.world_vectors) {
    values.segment<3>(start) = (rotation.transpose() * values.segment<3>(start)).eval();
  }
}

// A row at a time: of so few numbers that products of any size would take longer to set up.
void Block::turn(Eigen::Ref<Rows> by_world, const Eigen::Matrix3d& rotation) const {
  for (const int start : given.world_vectors) {
    for (Eigen::Index row = 0; row < by_world.rows(); ++row) {
      by_world.block<1, 3>(row, start) =
          (by_world.block<1, 3>(row, start) * rotation.transpose()).eval();
    }
  }
}

void Block::add_by_increment(const Eigen::Ref<const Rows>& by_inner,
                             Eigen::Ref<Eigen::MatrixXd> by_increment) const {
  if (basis.size() == 0) {
    by_increment += by_inner;
  } else {
    by_increment.noalias() += by_inner * basis;
  }
}

// With v = R^T inner and R <- R exp(turn): v <- v - turn x v.
void Block::add_by_turn(const Eigen::Ref<const Rows>& by_world,
                        const Eigen::Map<const Eigen::VectorXd>& in_world,
                        Eigen::Ref<Eigen::Matrix<double, Eigen::Dynamic, 3>> by_turn) const {
  for (const int start : given.world_vectors) {
    const Eigen::Matrix3d turned = hat(Eigen::Vector3d(in_world.segment<3>(start)));
    for (Eigen::Index row = 0; row < by_world.rows(); ++row) {
      by_turn.row(row) += by_world.block<1, 3>(row, start) * turned;
    }
  }
}

}  // namespace hybrid_slam
