#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "cameras/geometry/rigid3d.h"

#include <Eigen/Core>

namespace hybrid_slam {

// A dense piece of the normal equations, over a few variables: the lower triangle of
//   [ H   .  ]   H = sum J^T J,  g = sum J^T r,
//   [ g^T .  ]   as many rows per variable as its tangent has, and one for the gradient
// to which terms add what they have. Slots number the variables of the piece.
class Front {
 public:
  // `slot_of` maps every variable of the problem to its slot, valid for those of this front.
  // `offsets`: the first row of each slot, and the number of all rows.
  Front(std::vector<Eigen::Index> offsets, const std::vector<std::uint32_t>& slot_of)
      : offsets_(std::move(offsets)),
        matrix_(Eigen::MatrixXd::Zero(offsets_.back() + 1, offsets_.back())),
        scale_(Eigen::VectorXd::Zero(offsets_.back())),
        slot_of_(&slot_of) {}

  // Poses alone, six rows each.
  Front(std::size_t poses, const std::vector<std::uint32_t>& slot_of)
      : Front(six_each(poses), slot_of) {}

  std::uint32_t slot(std::uint32_t variable) const { return (*slot_of_)[variable]; }
  Eigen::Index row(std::uint32_t slot) const { return offsets_[slot]; }

  // H(a, b) += block, which lands in the lower triangle; of a diagonal block all is added.
  template <typename Derived>
  void add(std::uint32_t slot_a, std::uint32_t slot_b, const Eigen::MatrixBase<Derived>& block) {
    constexpr int kRows = Derived::RowsAtCompileTime;
    constexpr int kCols = Derived::ColsAtCompileTime;
    const Eigen::Index a = offsets_[slot_a];
    const Eigen::Index b = offsets_[slot_b];
    if (slot_a >= slot_b) {
      matrix_.template block<kRows, kCols>(a, b, block.rows(), block.cols()) += block;
    } else {
      matrix_.template block<kCols, kRows>(b, a, block.cols(), block.rows()) += block.transpose();
    }
  }

  template <typename Derived>
  void add_gradient(std::uint32_t slot, const Eigen::MatrixBase<Derived>& gradient) {
    constexpr int kRows = Derived::RowsAtCompileTime;
    matrix_.row(matrix_.rows() - 1).template segment<kRows>(offsets_[slot], gradient.rows()) +=
        gradient.transpose();
  }

  // The size of what was added to the diagonal of H, before anything was eliminated from it: what
  // is left there of this size times the precision of a double is rounding, and says nothing.
  template <typename Derived>
  void add_scale(std::uint32_t slot, const Eigen::MatrixBase<Derived>& diagonal) {
    constexpr int kRows = Derived::RowsAtCompileTime;
    scale_.template segment<kRows>(offsets_[slot], diagonal.rows()) += diagonal;
  }

  // Rows over these variables, each from its offset on, and their residuals: J^T J, J^T r and the
  // scale. For few rows: each pair of variables by itself.
  void add_rows(std::span<const std::uint32_t> variables, std::span<const Eigen::Index> offsets,
                const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& residual);
  // What the elimination of an unknown of three numbers takes from these variables: with
  // U = reduced, by rows, -U U^T and -U half_solved.
  void subtract_reduced(std::span<const std::uint32_t> variables,
                        std::span<const Eigen::Index> offsets,
                        const Eigen::Map<const Eigen::MatrixX3d>& reduced,
                        const Eigen::Vector3d& half_solved);

  // All of a term that is dense: information and gradient over these variables, each from its
  // offset on (one more than variables).
  void add_dense(std::span<const std::uint32_t> variables, std::span<const Eigen::Index> offsets,
                 const Eigen::MatrixXd& information, const Eigen::VectorXd& gradient);

  Eigen::MatrixXd& matrix() { return matrix_; }
  Eigen::VectorXd& scale() { return scale_; }

 private:
  template <int kRows>
  void add_rows_of(std::span<const std::uint32_t> variables, std::span<const Eigen::Index> offsets,
                   const Eigen::MatrixXd& jacobian, const Eigen::VectorXd& residual);

  static std::vector<Eigen::Index> six_each(std::size_t poses) {
    std::vector<Eigen::Index> offsets;
    for (std::size_t i = 0; i <= poses; ++i) offsets.push_back(static_cast<Eigen::Index>(6 * i));
    return offsets;
  }

  std::vector<Eigen::Index> offsets_;
  Eigen::MatrixXd matrix_;  // (n + 1) x n
  Eigen::VectorXd scale_;   // n
  const std::vector<std::uint32_t>* slot_of_;
};

// Where the terms of a linear problem over poses and other blocks, its variables, come from. A term
// is a set of variables with a quadratic function of their tangents.
class TermSource {
 public:
  virtual ~TermSource() = default;
  // Of a variable that is shared (PoseTree::add), those alone that have no other kind of variable.
  virtual std::span<const std::uint32_t> terms_of(std::uint32_t variable) const = 0;
  virtual std::span<const std::uint32_t> poses_of(std::uint32_t term) const = 0;
  virtual void assemble(std::uint32_t term, Front& front) const = 0;
  // Of these terms, which are gone through in their order, the one at `at` is next: what comes
  // after it may be brought into the cache, what poses_of() or what assemble() reads.
  virtual void fetch_poses(std::span<const std::uint32_t> /*terms*/, std::size_t /*at*/) const {}
  virtual void fetch(std::span<const std::uint32_t> /*terms*/, std::size_t /*at*/) const {}
  // Whether any term has this variable.
  virtual bool has_terms(std::uint32_t variable) const { return !terms_of(variable).empty(); }
};

}  // namespace hybrid_slam
