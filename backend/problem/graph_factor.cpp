#include "backend/problem/graph_factor.h"

#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include <algorithm>
#include <cmath>

namespace hybrid_slam {

namespace {

constexpr const char* kKinds[] = {"pose", "point", "block"};

std::string name_of(const GraphVariable& variable) {
  return std::string(kKinds[static_cast<std::size_t>(variable.kind)]) + " " +
         std::to_string(variable.index);
}

}  // namespace

std::string block_fault(const GraphBlock& block) {
  const auto size = static_cast<int>(block.values.size());
  if (size == 0) return "has no values";
  if (!block.values.allFinite()) return "values are not finite";
  if (block.manifold != nullptr && block.manifold->AmbientSize() != size) {
    return "its manifold is for " + std::to_string(block.manifold->AmbientSize()) +
           " values, not " + std::to_string(size);
  }
  if (!block.world_vectors.empty() && block.rides_with == GraphBlock::kNone) {
    return "world_vectors turn with no frame";
  }
  std::vector<int> starts = block.world_vectors;
  std::sort(starts.begin(), starts.end());
  for (std::size_t i = 0; i < starts.size(); ++i) {
    if (starts[i] < 0 || starts[i] + 3 > size || (i > 0 && starts[i] < starts[i - 1] + 3)) {
      return "world_vectors: three values from " + std::to_string(starts[i]) + " on are not there";
    }
  }
  return {};
}

std::string factor_fault(const GraphFactor& factor,
                         const std::function<VariableSize(const GraphVariable&)>& size_of) {
  if (factor.function == nullptr) return "has no function";
  const std::vector<int>& sizes = factor.function->parameter_block_sizes();
  if (sizes.size() != factor.variables.size() || sizes.empty()) {
    return "its function is of " + std::to_string(sizes.size()) + " variables, not " +
           std::to_string(factor.variables.size());
  }
  if (factor.function->num_residuals() < 1) return "its function has no residuals";
  if (!(factor.threshold > 0) || !std::isfinite(factor.threshold)) {
    return "threshold must be positive and finite";
  }
  int points = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const GraphVariable& variable = factor.variables[i];
    const VariableSize found = size_of(variable);
    if (found.fault != nullptr) return name_of(variable) + " " + found.fault;
    if (found.size != sizes[i]) {
      return name_of(variable) + " has " + std::to_string(found.size) + " numbers, its function " +
             "takes " + std::to_string(sizes[i]);
    }
    points += variable.kind == GraphVariable::Kind::kPoint ? 1 : 0;
    for (std::size_t k = 0; k < i; ++k) {
      if (factor.variables[k] == variable) return name_of(variable) + " comes twice";
    }
  }
  return points > 1 ? "has more than one point" : std::string();
}

}  // namespace hybrid_slam
