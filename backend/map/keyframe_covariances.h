#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "backend/map/ids.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// Part of the Cholesky factor L of an information matrix L L^T: cliques of variables that are
// eliminated together, each with all that are eliminated after it up to a root. It holds the joint
// covariance of all its variables.
struct CholeskyPaths {
  struct Clique {
    std::vector<std::uint32_t> frontals;   // its variables, by their places in `variables`
    std::vector<std::uint32_t> separator;  // of those that later cliques have: what it touches
    Eigen::MatrixXd factor;                // (f + s) x f: [L11; L21]
  };
  std::vector<std::uint32_t> variables;     // ascending, by their owner's numbers
  std::vector<Eigen::Index> offsets = {0};  // of their rows, and the number of all rows
  std::vector<Clique> cliques;              // those below before those above

  Eigen::Index rows() const { return offsets.back(); }
  Eigen::Index size(std::uint32_t at) const { return offsets[at + 1] - offsets[at]; }

  // B (L L^T)^-1 B^T, of B^T with a row per row of all variables. By forward substitution, of those
  // cliques alone that it touches.
  Eigen::MatrixXd covariance(Eigen::MatrixXd transposed) const;
};

// How certain the poses of keyframes are against the map's origin, jointly: as the optimiser left
// it (docs/conventions.md). Immutable.
class KeyframeCovariances {
 public:
  struct Known {
    KeyframeId id;
    std::uint32_t at = 0;  // its place in the paths' variables
    Matrix6d by_variable;  // derivative of the pose's left perturbation by its variable
  };
  // How something differs with a keyframe's left perturbation: one row per number of it.
  using Derivative = std::pair<KeyframeId, Eigen::Matrix<double, Eigen::Dynamic, 6>>;

  // `known`: ascending by id.
  KeyframeCovariances(KeyframeId origin, CholeskyPaths paths, std::vector<Known> known);

  // The origin, which is certain, is known, too.
  bool knows(KeyframeId id) const { return id == origin_ || find(id) != nullptr; }

  // Of the keyframe's left perturbation, (translation, rotation) [m, rad]; of one that is known.
  Matrix6d covariance(KeyframeId id) const;

  // Covariance of the sum of derivative * left perturbation; all as many rows, of keyframes that
  // are known, at least one. The same one may come more than once.
  Eigen::MatrixXd covariance(std::span<const Derivative> derivatives) const;

 private:
  const Known* find(KeyframeId id) const;

  KeyframeId origin_;
  CholeskyPaths paths_;
  std::vector<Known> known_;
};

}  // namespace hybrid_slam
