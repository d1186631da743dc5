#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "backend/problem/loss.h"

#include <Eigen/Core>

namespace ceres {
class CostFunction;
class Manifold;
}  // namespace ceres

namespace hybrid_slam {

// Variables and factors of any kind, for graphs that know more than poses and points: velocities
// and biases, directions, clock offsets, calibrations. docs/adding_a_factor.md shows how.

// A variable of a factor: a frame's pose, a point or a block, by its index among those.
struct GraphVariable {
  enum class Kind : std::uint8_t { kPose, kPoint, kBlock };

  Kind kind = Kind::kPose;
  std::uint32_t index = 0;

  friend bool operator==(const GraphVariable&, const GraphVariable&) = default;
};

inline GraphVariable pose_variable(std::uint32_t frame) {
  return {GraphVariable::Kind::kPose, frame};
}
inline GraphVariable point_variable(std::uint32_t point) {
  return {GraphVariable::Kind::kPoint, point};
}
inline GraphVariable block_variable(std::uint32_t block) {
  return {GraphVariable::Kind::kBlock, block};
}

// A variable that is neither a pose nor a point: some numbers, which form a vector or lie on a
// manifold.
struct GraphBlock {
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  Eigen::VectorXd values;
  std::shared_ptr<const ceres::Manifold> manifold = nullptr;  // null: a vector
  // The frame that the block belongs to: it leaves the window with it. kNone: it stays.
  std::uint32_t rides_with = kNone;
  // Where three of the values each are a vector along the world's axes that turns with that frame,
  // such as its velocity; all others are the frame's own or nobody's. With a manifold, rotations of
  // these values must map it to itself, as they do a sphere.
  std::vector<int> world_vectors = {};
  bool fixed = false;
  // Many factors share it, as they do a calibration: it is eliminated after all others.
  bool shared = false;
};

// A term |function(variables)|^2 with a loss. `function` has one parameter block per variable, in
// this order: 7 numbers of a pose (quaternion x y z w and translation of cam_from_world), 3 of a
// point, a block's values. Its Jacobians are by these numbers, as those of a
// ceres::AutoDiffCostFunction are, unless it is a factor of this project (factors/left_jacobian.h).
struct GraphFactor {
  std::shared_ptr<const ceres::CostFunction> function;
  std::vector<GraphVariable> variables;  // distinct; at most one point
  Loss loss = Loss::kNone;
  double threshold = 1;  // squared residual at which the loss sets in
};

// What is wrong with a block or factor in itself; empty if it can be used. size_of gives how many
// numbers a variable has, or says why there is no such variable.
struct VariableSize {
  int size = 0;
  const char* fault = nullptr;
};
std::string block_fault(const GraphBlock& block);
std::string factor_fault(const GraphFactor& factor,
                         const std::function<VariableSize(const GraphVariable&)>& size_of);

}  // namespace hybrid_slam
