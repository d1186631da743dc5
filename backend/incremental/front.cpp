#include "backend/incremental/front.h"

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

}  // namespace hybrid_slam
