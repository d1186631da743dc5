#include "backend/incremental/rows_term.h"

#include "backend/incremental/front.h"

namespace hybrid_slam {

void RowsTerm::assemble(Front& front) const {
  // Up to so many rows products of any size take longer to set up than to do.
  constexpr Eigen::Index kFewRows = 16;
  if (rows.residual.size() == 0) return;
  if (rows.residual.size() <= kFewRows) {
    front.add_rows(variables, offsets, rows.jacobian, rows.residual);
    return;
  }
  const Eigen::MatrixXd information = rows.jacobian.transpose() * rows.jacobian;
  const Eigen::VectorXd gradient = rows.jacobian.transpose() * rows.residual;
  front.add_dense(variables, offsets, information, gradient);
  for (std::size_t i = 0; i < variables.size(); ++i) {
    front.add_scale(front.slot(variables[i]),
                    information.diagonal().segment(offsets[i], offsets[i + 1] - offsets[i]));
  }
}

}  // namespace hybrid_slam
