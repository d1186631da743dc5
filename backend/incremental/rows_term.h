#pragma once

#include <cstdint>
#include <vector>

#include "backend/incremental/marginalization.h"

namespace hybrid_slam {

class Front;

// A term of any kind, linearised: rows over the deltas of its variables, in their order,
//   r = residual + sum_i jacobian_i delta_i.
// Of a factor, or what marginalised variables left on others.
struct RowsTerm {
  std::vector<std::uint32_t> variables;     // that vary, distinct
  std::vector<Eigen::Index> offsets = {0};  // of their columns, and the number of all columns
  LinearSystem rows;

  void assemble(Front& front) const;
};

}  // namespace hybrid_slam
