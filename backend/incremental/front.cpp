#include "backend/incremental/front.h"

#include "backend/incremental/scratch.h"

namespace hybrid_slam {

void Front::add_dense(std::span<const std::uint32_t> variables,
                      std::span<const Eigen::Index> offsets, const Eigen::MatrixXd& information,
                      const Eigen::VectorXd& gradient) {
  for (std::size_t j = 0; j < variables.size(); ++j) {
    const Eigen::Index columns = offsets[j + 1] - offsets[j];
    const std::uint32_t slot_j = slot(variables[j]);
    for (std::size_t i = j; i < variables.size(); ++i) {
      add(slot(variables[i]), slot_j,
          information.block(offsets[i], offsets[j], offsets[i + 1] - offsets[i], columns));
    }
    add_gradient(slot_j, gradient.segment(offsets[j], columns));
  }
}

void Front::add_rows(std::span<const std::uint32_t> variables,
                     std::span<const Eigen::Index> offsets, const Eigen::MatrixXd& jacobian,
                     const Eigen::VectorXd& residual) {
  Scratch<double, 512> numbers(static_cast<std::size_t>(jacobian.size()));
  Eigen::Map<Eigen::MatrixXd> by_row(numbers.data(), jacobian.cols(), jacobian.rows());
  by_row = jacobian.transpose();
  for (std::size_t j = 0; j < variables.size(); ++j) {
    const std::uint32_t slot_j = slot(variables[j]);
    for (Eigen::Index b = 0; b < offsets[j + 1] - offsets[j]; ++b) {
      const auto by_b = jacobian.col(offsets[j] + b);
      const Eigen::Index at_b = offsets_[slot_j] + b;
      matrix_(matrix_.rows() - 1, at_b) += by_b.dot(residual);
      scale_[at_b] += by_b.squaredNorm();
      for (std::size_t i = 0; i < variables.size(); ++i) {
        const std::uint32_t slot_i = slot(variables[i]);
        if (slot_i < slot_j) continue;
        const Eigen::Index size = offsets[i + 1] - offsets[i];
        auto column = matrix_.col(at_b).segment(offsets_[slot_i], size);
        for (Eigen::Index row = 0; row < by_b.size(); ++row) {
          const auto by_a = by_row.col(row).segment(offsets[i], size);
          if (size == 6) {
            column.head<6>() += by_b[row] * by_a.head<6>();
          } else {
            column += by_b[row] * by_a;
          }
        }
      }
    }
  }
}

void Front::subtract_reduced(std::span<const std::uint32_t> variables,
                             std::span<const Eigen::Index> offsets,
                             const Eigen::Map<const Eigen::MatrixX3d>& reduced,
                             const Eigen::Vector3d& half_solved) {
  for (std::size_t j = 0; j < variables.size(); ++j) {
    const std::uint32_t slot_j = slot(variables[j]);
    const Eigen::Index columns = offsets[j + 1] - offsets[j];
    for (std::size_t i = 0; i < variables.size(); ++i) {
      const std::uint32_t slot_i = slot(variables[i]);
      if (slot_i < slot_j) continue;
      const Eigen::Index rows = offsets[i + 1] - offsets[i];
      if (rows == 6 && columns == 6) {
        matrix_.block<6, 6>(offsets_[slot_i], offsets_[slot_j]).noalias() -=
            reduced.middleRows<6>(offsets[i]) * reduced.middleRows<6>(offsets[j]).transpose();
      } else {
        matrix_.block(offsets_[slot_i], offsets_[slot_j], rows, columns) -=
            reduced.middleRows(offsets[i], rows)
                .lazyProduct(reduced.middleRows(offsets[j], columns).transpose());
      }
    }
    matrix_.row(matrix_.rows() - 1).segment(offsets_[slot_j], columns) -=
        reduced.middleRows(offsets[j], columns).lazyProduct(half_solved).transpose();
  }
}

}  // namespace hybrid_slam
