#pragma once

#include <cstdint>
#include <vector>

#include "backend/incremental/front.h"
#include "backend/incremental/marginalization.h"

namespace hybrid_slam {

// A term of any kind, linearised: rows over the deltas of its variables, in their order,
//   r = residual + sum_i jacobian_i delta_i.
// Of a factor, or what marginalised variables left on others.
struct RowsTerm {
  std::vector<std::uint32_t> variables;     // that vary, distinct
  std::vector<Eigen::Index> offsets = {0};  // of their columns, and the number of all columns
  LinearSystem rows;

  void assemble(Front& front) const {
    if (rows.residual.size() == 0) return;
    const Eigen::MatrixXd information = rows.jacobian.transpose() * rows.jacobian;
    const Eigen::VectorXd gradient = rows.jacobian.transpose() * rows.residual;
    front.add_dense(variables, offsets, information, gradient);
    for (std::size_t i = 0; i < variables.size(); ++i) {
      front.add_scale(front.slot(variables[i]),
                      information.diagonal().segment(offsets[i], offsets[i + 1] - offsets[i]));
    }
  }
};

}  // namespace hybrid_slam
