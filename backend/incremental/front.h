#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cameras/geometry/rigid3d.h"

#include <Eigen/Core>

namespace hybrid_slam {

// A dense piece of the normal equations, over a few poses: the lower triangle of
//   [ H   .  ]   H = sum J^T J,  g = sum J^T r,
//   [ g^T .  ]   6 rows per pose and one for the gradient
// to which terms add what they have. Slots number the poses of the piece.
class Front {
 public:
  // `slot_of` maps every pose of the problem to its slot, valid for those of this front.
  Front(std::size_t poses, const std::vector<std::uint32_t>& slot_of)
      : matrix_(Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(6 * poses + 1),
                                      static_cast<Eigen::Index>(6 * poses))),
        scale_(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(6 * poses))),
        slot_of_(&slot_of) {}

  std::uint32_t slot(std::uint32_t pose) const { return (*slot_of_)[pose]; }

  // H(a, b) += block, which lands in the lower triangle; of a diagonal block all is added.
  template <typename Derived>
  void add(std::uint32_t slot_a, std::uint32_t slot_b, const Eigen::MatrixBase<Derived>& block) {
    if (slot_a >= slot_b) {
      matrix_.block<6, 6>(6 * slot_a, 6 * slot_b) += block;
    } else {
      matrix_.block<6, 6>(6 * slot_b, 6 * slot_a) += block.transpose();
    }
  }

  template <typename Derived>
  void add_gradient(std::uint32_t slot, const Eigen::MatrixBase<Derived>& gradient) {
    matrix_.row(matrix_.rows() - 1).segment<6>(6 * slot) += gradient.transpose();
  }

  // The size of what was added to the diagonal of H, before anything was eliminated from it: what
  // is left there of this size times the precision of a double is rounding, and says nothing.
  template <typename Derived>
  void add_scale(std::uint32_t slot, const Eigen::MatrixBase<Derived>& diagonal) {
    scale_.segment<6>(6 * slot) += diagonal;
  }

  Eigen::MatrixXd& matrix() { return matrix_; }
  Eigen::VectorXd& scale() { return scale_; }

 private:
  Eigen::MatrixXd matrix_;  // (6 n + 1) x 6 n
  Eigen::VectorXd scale_;   // 6 n
  const std::vector<std::uint32_t>* slot_of_;
};

// Where the terms of a linear problem over poses come from. A term is a set of poses with a
// quadratic function of their tangents.
class TermSource {
 public:
  virtual ~TermSource() = default;
  virtual std::span<const std::uint32_t> terms_of(std::uint32_t pose) const = 0;
  virtual std::span<const std::uint32_t> poses_of(std::uint32_t term) const = 0;
  virtual void assemble(std::uint32_t term, Front& front) const = 0;
};

}  // namespace hybrid_slam
