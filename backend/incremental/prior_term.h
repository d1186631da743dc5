#pragma once

#include <cstdint>
#include <vector>

#include "backend/incremental/front.h"
#include "backend/incremental/marginalization.h"

namespace hybrid_slam {

// What marginalised poses left on others: rows over the deltas of `poses`, in their order.
struct PriorTerm {
  std::vector<std::uint32_t> poses;
  LinearSystem rows;

  void assemble(Front& front) const {
    const Eigen::MatrixXd information = rows.jacobian.transpose() * rows.jacobian;
    const Eigen::VectorXd gradient = rows.jacobian.transpose() * rows.residual;
    for (std::size_t j = 0; j < poses.size(); ++j) {
      const auto column = static_cast<Eigen::Index>(6 * j);
      const std::uint32_t slot_j = front.slot(poses[j]);
      for (std::size_t i = j; i < poses.size(); ++i) {
        front.add(front.slot(poses[i]), slot_j,
                  information.block<6, 6>(static_cast<Eigen::Index>(6 * i), column));
      }
      front.add_gradient(slot_j, gradient.segment<6>(column));
      front.add_scale(slot_j, information.diagonal().segment<6>(column));
    }
  }
};

}  // namespace hybrid_slam
