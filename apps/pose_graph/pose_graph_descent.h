#pragma once

#include <deque>
#include <functional>
#include <stop_token>
#include <vector>

#include "apps/pose_graph/pose_graph_structure.h"
#include "factors/relative_pose_factor.h"

namespace hybrid_slam {

struct PoseGraphDescentOptions {
  int iterations = 30;
  double function_tolerance = 1e-7;  // ends where a step promises less of the cost
  // Of the error of a linear step, in the norm of the normal equations: beyond the first step the
  // equations are solved by conjugate gradients with the first one's Cholesky factor.
  double step_tolerance = 0.1;
  int step_iterations = 2;  // if they do not suffice, the next step is factored anew
};

enum class DescentEnd {
  kConverged,
  kIterationLimit,
  kStopped,  // on request
  kUphill    // a step raised the cost, or could not be computed: a trust region is needed
};

struct PoseGraphDescent {
  DescentEnd end = DescentEnd::kIterationLimit;
  double initial_cost = 0;  // half the sum of squares
  double cost = 0;
  int iterations = 0;
  int factorizations = 0;
};

// Gauss-Newton on the edges of a graph, for starts near the optimum: one Cholesky factor serves
// many steps, each of which costs an evaluation and a few solutions with it. The factors and their
// residual are those of the Ceres solver, and so is the optimum. No robust loss.
class PoseGraphProblem {
 public:
  explicit PoseGraphProblem(const FactorGraph& graph);

  const PoseGraphStructure& structure() const { return structure_; }

  // Half the sum of squares.
  double cost(const std::vector<Rigid3d>& cam_from_world) const;

  // Moves the poses but for the structure's known frames, downhill only. `progress` is told the
  // number and the cost of each step.
  PoseGraphDescent descend(std::vector<Rigid3d>& cam_from_world,
                           const PoseGraphDescentOptions& options, const std::stop_token& stop = {},
                           const std::function<void(int, double)>& progress = {}) const;

 private:
  // The normal equations at the poses, matrix * step = -gradient; returns the cost.
  double linearize(const std::vector<Rigid3d>& cam_from_world, BlockMatrix<6>& matrix,
                   Eigen::VectorXd& gradient) const;
  std::vector<Rigid3d> moved(const std::vector<Rigid3d>& cam_from_world,
                             const Eigen::VectorXd& step) const;

  PoseGraphStructure structure_;
  std::deque<RelativePoseFactor> factors_;  // as structure_.couplings
};

}  // namespace hybrid_slam
