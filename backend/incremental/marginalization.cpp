#include "backend/incremental/marginalization.h"

#include <algorithm>

#include <Eigen/QR>

namespace hybrid_slam {

namespace {

// Columns whose remaining norm is below this fraction of the largest column's are not determined.
constexpr double kRankTolerance = 1e-9;

// Reflects the rows from `top` on so that column `column` vanishes below `top`. False, and nothing
// done, if it is (nearly) zero already.
bool reflect(Eigen::MatrixXd& rows, Eigen::Index top, Eigen::Index column, double least) {
  const Eigen::Index count = rows.rows() - top;
  if (count <= 0) return false;
  auto tail = rows.col(column).tail(count);
  if (tail.norm() <= least) {
    tail.setZero();
    return false;
  }
  Eigen::VectorXd essential(count - 1);
  double tau = 0;
  double beta = 0;
  tail.makeHouseholder(essential, tau, beta);
  Eigen::VectorXd workspace(rows.cols() - column);
  rows.bottomRightCorner(count, rows.cols() - column)
      .applyHouseholderOnTheLeft(essential, tau, workspace.data());
  tail.tail(count - 1).setZero();
  return true;
}

}  // namespace

LinearSystem marginalize(const LinearSystem& system, Eigen::Index count) {
  const Eigen::Index columns = system.jacobian.cols();
  Eigen::MatrixXd rows(system.jacobian.rows(), columns + 1);
  rows << system.jacobian, system.residual;
  if (rows.rows() > rows.cols()) {  // in blocks, which is fast, down to a triangle
    const Eigen::MatrixXd triangle = Eigen::HouseholderQR<Eigen::MatrixXd>(rows)
                                         .matrixQR()
                                         .topRows(rows.cols())
                                         .triangularView<Eigen::Upper>();
    rows = triangle;
  }
  const double least =
      kRankTolerance * (columns == 0 ? 0 : rows.leftCols(columns).colwise().norm().maxCoeff());
  Eigen::Index top = 0;
  for (Eigen::Index column = 0; column < count; ++column) {
    if (reflect(rows, top, column, least)) ++top;
  }
  const Eigen::Index first = top;
  for (Eigen::Index column = count; column < columns; ++column) {
    if (reflect(rows, top, column, least)) ++top;
  }
  return {rows.block(first, count, top - first, columns - count),
          rows.col(columns).segment(first, top - first)};
}

}  // namespace hybrid_slam
