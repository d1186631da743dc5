#pragma once

#include <vector>

#include "backend/problem/bundle_structure.h"
#include "backend/problem/problem_builder.h"
#include "backend/problem/robust_loss.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

struct BundleLosses {
  RobustLoss mono;    // of observations with a residual of two rows
  RobustLoss stereo;  // of three rows
  RobustLoss loop;    // of edges that are loops
};

struct BundleEstimate {
  std::vector<Rigid3d> cam_from_world;          // as FactorGraph::frames
  std::vector<Eigen::Vector3d> point_in_world;  // as BundleStructure::points
};

// Increments: exp(delta) * cam_from_world of the frame of each row, six numbers each, and those of
// the points that vary, three each.
struct BundleStep {
  Eigen::VectorXd poses;
  Eigen::VectorXd points;
};

// The normal equations of a bundle adjustment with known intrinsics, and their solution by the
// Schur complement: with the damped information of a point V = L L^T and W_i the product of the
// derivatives by a pose that sees it and by the point, U_i = W_i L^-T,
//   S_ij = H_ij - sum U_i U_j^T,   S d_poses = -(g - sum U_i L^-1 g_point),
//   d_point = -V^-1 (g_point + sum W_i^T d_i).
// A term with a loss counts by its weight at the linearisation, as in Ceres. The graph, its factors
// and the structure must outlive it.
class BundleEquations {
 public:
  BundleEquations(const FactorGraph& graph, const GraphFactors& factors,
                  const BundleStructure& structure, const BundleLosses& losses);

  // Half the sum of squares with the losses. Infinite if a term cannot be evaluated.
  double cost(const BundleEstimate& at) const;

  // The same, and the equations of this estimate, if it is finite.
  double linearize(const BundleEstimate& at);

  // The units in which the damping is the same in all directions: those that the linearisation of
  // now suggests. Needed once, before the first step.
  void set_scale();

  // The step of Levenberg and Marquardt in a trust region. False if there is none.
  bool solve(double radius, BundleStep& step);

  // By how much the linearised terms say that the cost falls with the step solved last.
  double model_decrease() const { return model_decrease_; }

  // Half the derivative of the sum of squares.
  const Eigen::VectorXd& pose_gradient() const { return pose_gradient_; }
  const Eigen::VectorXd& point_gradient() const { return point_gradient_; }

 private:
  using Block63 = Eigen::Matrix<double, 6, 3>;

  struct EdgeBlock {
    int row_a;
    int row_b;
    Matrix6d by_both;  // of (a, b)
  };

  double edges_cost(const BundleEstimate& at) const;
  double linearize_edges(const BundleEstimate& at);
  double linearize_point(std::uint32_t p, const BundleEstimate& at);
  // again: the term before was of the same view.
  template <int kRows>
  double add_term(const BundleTerm& term, std::uint32_t p, bool again, double* residual,
                  double* by_pose, double* by_point);

  void find_blocks();
  bool eliminate_points(double radius);
  bool eliminate_group(std::size_t group, double radius);
  bool halve(std::uint32_t p, double radius);
  void add_poses(double radius);
  bool solve_reduced(Eigen::VectorXd& step);
  void solve_points(const Eigen::VectorXd& poses, Eigen::VectorXd& points) const;
  void judge(double radius, const BundleStep& step);

  const FactorGraph& graph_;
  const GraphFactors& factors_;
  const BundleStructure& structure_;
  BundleLosses losses_;

  std::vector<Matrix6d> pose_information_;  // per row
  Eigen::VectorXd pose_gradient_;
  std::vector<EdgeBlock> edge_blocks_;              // as structure.edges
  std::vector<Eigen::Matrix3d> point_information_;  // per varying point
  Eigen::VectorXd point_gradient_;
  std::vector<Block63> cross_;  // W per view

  // The squares of Ceres' Jacobi scaling, inverted.
  Eigen::VectorXd pose_units_;
  Eigen::VectorXd point_units_;

  std::vector<Eigen::Matrix3d> halves_;  // L^-1 per varying point
  std::vector<double> panels_;           // U of some points of a group
  std::vector<Eigen::Index> blocks_;     // of the reduced system, for each pair of rows of a group
  std::vector<std::size_t> first_blocks_;  // per group
  BlockMatrix<6> reduced_;
  Eigen::VectorXd reduced_right_;
  BlockCholesky cholesky_;
  double model_decrease_ = 0;
};

}  // namespace hybrid_slam
