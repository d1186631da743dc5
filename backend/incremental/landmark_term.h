#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/incremental/marginalization.h"
#include "cameras/geometry/rigid3d.h"

#include <Eigen/Core>

namespace hybrid_slam {

class Front;

// One observation of a landmark, linearised: with delta the sum of its pose's increments
// (backend/incremental/world_tangent.h) and d the displacement of the landmark,
//   r = residual + by_pose * delta + by_point * d
// in standard deviations. Two-row measurements leave the third row zero.
struct LandmarkView {
  std::uint32_t observation = 0;
  std::uint32_t pose = 0;
  bool fixed = false;   // the pose is known: by_pose is zero
  bool usable = false;  // the point projects
  Eigen::Matrix<double, 3, 6> by_pose = Eigen::Matrix<double, 3, 6>::Zero();
  Eigen::Matrix3d by_point = Eigen::Matrix3d::Zero();
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 6, 3> reduced =
      Eigen::Matrix<double, 6, 3>::Zero();  // by_pose^T by_point L^-T
};

// A factor of any kind that has the landmark among its variables, linearised, with the deltas of
// the others:
//   r = residual + sum_i by_variable_i * delta_i + by_point * d
struct FactorView {
  std::uint32_t factor = 0;
  std::vector<std::uint32_t> variables;     // that vary, distinct
  std::vector<Eigen::Index> offsets = {0};  // of their columns, and the number of all columns
  bool usable = false;
  LinearSystem rows;
  Eigen::Matrix<double, Eigen::Dynamic, 3> by_point;
  Eigen::Matrix<double, Eigen::Dynamic, 3> reduced;  // by_variables^T by_point L^-T

  // Asks for what it keeps elsewhere.
  void fetch() const;
};

// What tells whether a landmark with factors has to be evaluated (IncrementalSolver::has_changed):
// by how much the residuals change with each component of `poses`, and with each of a motion in
// common; the deltas of `poses` when it was evaluated last.
struct LandmarkChange {
  std::vector<float> reach;
  std::vector<float> evaluated_at;
};

// The Cholesky factor of a point's information. False if that does not determine the point.
bool factor_point(const Eigen::Matrix3d& information, Eigen::Matrix3d& factor);

// All observations of a landmark, with the landmark eliminated (Schur complement): what is left is
// a term on the poses that see it,
//   H(i, j) = [i = j] by_pose_i^T by_pose_i - reduced_i reduced_j^T.
struct LandmarkTerm {
  static constexpr std::uint32_t kNoAnchor = static_cast<std::uint32_t>(-1);

  Eigen::Vector3d base = Eigen::Vector3d::Zero();  // where it was linearised
  // A pose that carries the point along: the linear solution leaves out how that turns it since.
  std::uint32_t anchor = kNoAnchor;
  Eigen::Vector3d in_anchor = Eigen::Vector3d::Zero();  // base, in the anchor's frame
  Vector6d anchor_delta = Vector6d::Zero();             // when it was linearised
  std::vector<LandmarkView> views;
  std::vector<FactorView> factors;
  std::vector<std::uint32_t> poses;  // that vary, and other variables, of the views, in their order
  Eigen::Matrix3d factor = Eigen::Matrix3d::Identity();   // L, with L L^T = sum by_point^T by_point
  Eigen::Vector3d half_solved = Eigen::Vector3d::Zero();  // L^-1 sum by_point^T residual
  bool solvable = false;                                  // the views determine the point
  // What a judged step leaves out of the displacement, since with it the cost would be higher.
  Eigen::Vector3d held_back = Eigen::Vector3d::Zero();
  std::unique_ptr<LandmarkChange> change;  // null where there are no factors

  // How many views and factors can be used.
  std::size_t usable_count() const;

  // From the views' derivatives: factor, half_solved, reduced, solvable.
  void eliminate();

  // The displacement from `base` that minimises the term; delta_of(pose) gives a pose's delta,
  // delta_of_any(variable) that of any other.
  template <typename DeltaOf>
  Eigen::Vector3d displacement(const DeltaOf& delta_of) const {
    return displacement(delta_of, delta_of);
  }
  template <typename DeltaOf, typename DeltaOfAny>
  Eigen::Vector3d displacement(const DeltaOf& delta_of, const DeltaOfAny& delta_of_any) const {
    if (!solvable) return Eigen::Vector3d::Zero();
    Eigen::Vector3d right = half_solved;
    for (const FactorView& view : factors) {
      if (!view.usable) continue;
      for (std::size_t i = 0; i < view.variables.size(); ++i) {
        const Eigen::Index rows = view.offsets[i + 1] - view.offsets[i];
        right += view.reduced.middleRows(view.offsets[i], rows)
                     .transpose()
                     .lazyProduct(delta_of_any(view.variables[i]));
      }
    }
    for (const LandmarkView& view : views) {
      if (view.usable && !view.fixed) {
        right.noalias() += view.reduced.transpose() * delta_of(view.pose);
      }
    }
    return -factor.transpose().triangularView<Eigen::Upper>().solve(right);
  }

  void assemble(Front& front) const;

 private:
  void assemble_mixed(Front& front) const;
};

}  // namespace hybrid_slam
