#pragma once

#include "backend/problem/graph_factor.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// A block of a graph as an IncrementalSolver keeps it: by increments, like a pose. The values are
// kept in the frame that they ride with, where there is one, and increments add up there: so they
// mean the same before and after that frame was turned in the world, and terms that were linearised
// at different moments still add up (docs/backend.md). On a manifold an increment is a tangent
// along `basis`, which goes along with the block: projected to the tangent space of where it comes.
struct Block {
  std::uint32_t variable = 0;                 // of the solver's
  std::uint32_t carrier = GraphBlock::kNone;  // variable of the pose that it rides with
  bool there = true;
  GraphBlock given;
  Eigen::VectorXd inner;  // the values, in the carrier's axes, when the delta was folded_delta
  Eigen::VectorXd folded_delta;  // tangent size
  Eigen::MatrixXd basis;         // ambient x tangent; empty: the identity

  // `rotation`: of the carrier, cam_from_world.
  Block(const GraphBlock& block, const Eigen::Matrix3d& rotation);

  Eigen::Index tangent_size() const { return folded_delta.size(); }

  // The values that belong to a delta, in the carrier's axes.
  template <typename Derived>
  Eigen::VectorXd inner_at(const Eigen::MatrixBase<Derived>& delta) const {
    return delta == folded_delta ? inner : moved(delta - folded_delta);
  }
  // Makes what happened since the last time part of the estimate.
  void fold(const Eigen::VectorXd& delta);

  // Writes the values in the world that belong to a delta; `rotation` as above.
  void write(const Eigen::Map<const Eigen::VectorXd>& delta, const Eigen::Matrix3d& rotation,
             double* values) const;

  // Derivatives by the values, a row each.
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  // Takes those by the values in the world to those by the values in the carrier's axes, in place.
  void turn(Eigen::Ref<Rows> by_world, const Eigen::Matrix3d& rotation) const;
  // Adds the derivatives by an increment of the block, from those in the carrier's axes.
  void add_by_increment(const Eigen::Ref<const Rows>& by_inner,
                        Eigen::Ref<Eigen::MatrixXd> by_increment) const;
  // Adds what a turn of the carrier, along the world's axes, does by way of the block.
  void add_by_turn(const Eigen::Ref<const Rows>& by_world,
                   const Eigen::Map<const Eigen::VectorXd>& in_world,
                   Eigen::Ref<Eigen::Matrix<double, Eigen::Dynamic, 3>> by_turn) const;

 private:
  Eigen::VectorXd moved(const Eigen::VectorXd& increment) const;
};

}  // namespace hybrid_slam
