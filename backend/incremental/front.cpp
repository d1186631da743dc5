#include "backend/incremental/front.h"

#include "backend/incremental/scratch.h"

namespace hybrid_slam {

namespace {

// to += columns * factors, column by column.
template <typename Columns, typename Factors, typename To>
void add_product(const Columns& columns, const Factors& factors, To to) {
  for (Eigen::Index i = 0; i < factors.size(); ++i) to += factors[i] * columns.col(i);
}

}  // namespace

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
  if (residual.size() == 1) return add_rows_of<1>(variables, offsets, jacobian, residual);
  if (residual.size() == 2) return add_rows_of<2>(variables, offsets, jacobian, residual);
  if (residual.size() == 3) return add_rows_of<3>(variables, offsets, jacobian, residual);
  add_rows_of<Eigen::Dynamic>(variables, offsets, jacobian, residual);
}

// kRows: how many, where that is known.
template <int kRows>
void Front::add_rows_of(std::span<const std::uint32_t> variables,
                        std::span<const Eigen::Index> offsets, const Eigen::MatrixXd& jacobian,
                        const Eigen::VectorXd& residual) {
  const Eigen::Map<const Eigen::Matrix<double, kRows, Eigen::Dynamic>> by_column(
      jacobian.data(), jacobian.rows(), jacobian.cols());
  const Eigen::Map<const Eigen::Matrix<double, kRows, 1>> right(residual.data(), residual.size());
  Scratch<double, 512> numbers(static_cast<std::size_t>(jacobian.size()));
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, kRows>> by_row(numbers.data(), jacobian.cols(),
                                                                  jacobian.rows());
  by_row = by_column.transpose();
  const Eigen::Index last = matrix_.rows() - 1;
  for (std::size_t j = 0; j < variables.size(); ++j) {
    const std::uint32_t slot_j = slot(variables[j]);
    for (Eigen::Index b = offsets[j]; b < offsets[j + 1]; ++b) {
      const Eigen::Index at_b = offsets_[slot_j] + b - offsets[j];
      matrix_(last, at_b) += by_column.col(b).dot(right);
      scale_[at_b] += by_column.col(b).squaredNorm();
    }
    for (std::size_t i = 0; i < variables.size(); ++i) {
      const std::uint32_t slot_i = slot(variables[i]);
      if (slot_i < slot_j) continue;
      const Eigen::Index size = offsets[i + 1] - offsets[i];
      for (Eigen::Index b = offsets[j]; b < offsets[j + 1]; ++b) {
        auto column =
            matrix_.col(offsets_[slot_j] + b - offsets[j]).segment(offsets_[slot_i], size);
        if (size == 6) {
          add_product(by_row.template middleRows<6>(offsets[i]), by_column.col(b),
                      column.template head<6>());
        } else {
          add_product(by_row.middleRows(offsets[i], size), by_column.col(b), column);
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
