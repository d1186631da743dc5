#pragma once

#include <cstdint>
#include <vector>

#include "backend/incremental/front.h"

namespace hybrid_slam {

// The normal equations of a growing graph of poses, factored by block Cholesky as a tree of cliques
// (the Bayes tree of Kaess et al., iSAM2, IJRR 2012, in multifrontal form): each clique eliminates
// a few poses, and hands what that leaves on the poses it shares with the rest to its parent. When
// terms change, only the cliques of their poses and those above are factored anew, in a new order;
// the subtrees below keep what they handed up.
//
// Solves H delta = -g. Knows no linearisation and no landmarks: terms bring their blocks.
class PoseTree {
 public:
  struct Options {
    std::size_t max_padding = 2;  // blocks of zeros in a clique, for fewer cliques
    double damping = 1e-9;        // added to the diagonal of a clique that is singular
  };

  explicit PoseTree(const Options& options) : options_(options) {}

  // Poses are numbered from 0. A pose is part of the system once it was touched.
  void resize(std::size_t poses);

  // Cost of factoring anew what terms on these poses would touch, in multiplications; what is in
  // `marked` (a set of clique indices, kept by the caller between calls) is already paid for.
  double cost_of(std::span<const std::uint32_t> poses, std::vector<char>& marked) const;

  // Whether factoring anew what is marked includes all terms on these poses.
  bool is_marked(std::span<const std::uint32_t> poses, const std::vector<char>& marked) const;

  // Factors anew: the terms on these poses changed, came or went. Poses in `newest` are eliminated
  // last. A pose that has no term left leaves the system; its delta stays as it is.
  void refactor(const std::vector<std::uint32_t>& touched, const std::vector<std::uint32_t>& newest,
                const TermSource& terms);

  // Substitutes back from the root down to where no delta changes by more than `threshold` any
  // more. Appends the poses whose delta changed by more than that to `changed`.
  void solve(double threshold, std::vector<std::uint32_t>& changed);

  // Moves a pose by as much, whatever the system says. The next solve tells what changes against
  // that.
  void shift(std::uint32_t pose, const Vector6d& by) {
    delta_[pose] += by;
    sent_[pose] = delta_[pose];
    for (std::int32_t i = clique_of_[pose]; i != kNone && !at(i).fresh; i = at(i).parent) {
      at(i).fresh = true;
    }
  }

  const Vector6d& delta(std::uint32_t pose) const { return delta_[pose]; }

  // Of a pose's delta: its block of H^-1. Looks at the pose's clique and those above.
  Matrix6d covariance(std::uint32_t pose) const;

  std::size_t clique_count() const { return cliques_.size() - free_.size(); }
  double last_cost() const { return last_cost_; }  // of the last refactor, in multiplications
  std::size_t last_poses() const { return last_poses_; }
  int singular_cliques() const { return singular_; }  // ever met

 private:
  static constexpr std::int32_t kNone = -1;

  struct Clique {
    std::vector<std::uint32_t> frontals;
    std::vector<std::uint32_t> separator;
    Eigen::MatrixXd factor;        // (6 (f + s) + 1) x 6 f: [L11; L21; y^T]
    Eigen::MatrixXd contribution;  // (6 s + 1) x 6 s: what it hands to its parent
    std::int32_t parent = kNone;
    std::vector<std::int32_t> children;
    bool fresh = true;  // factored since it was last solved
  };

  Clique& at(std::int32_t i) { return cliques_[static_cast<std::size_t>(i)]; }
  const Clique& at(std::int32_t i) const { return cliques_[static_cast<std::size_t>(i)]; }
  std::int32_t make_clique();
  std::vector<std::uint32_t> detach(const std::vector<std::uint32_t>& touched,
                                    std::vector<std::int32_t>& orphans);
  std::vector<std::uint32_t> terms_inside(const std::vector<std::uint32_t>& poses,
                                          const TermSource& terms) const;
  std::vector<std::int32_t> build_cliques(const std::vector<std::uint32_t>& poses,
                                          const std::vector<std::uint32_t>& inside,
                                          const std::vector<std::int32_t>& orphans,
                                          const std::vector<std::uint32_t>& newest,
                                          const TermSource& terms);
  void factor(std::int32_t index, const std::vector<std::uint32_t>& own, const TermSource& terms);
  void add_contribution(const Clique& child, Front& front) const;
  void solve_clique(Clique& clique, double threshold, std::vector<std::uint32_t>& changed);

  Options options_;
  std::vector<Clique> cliques_;
  std::vector<std::int32_t> free_;
  std::vector<std::int32_t> clique_of_;  // by pose
  std::vector<Vector6d> delta_;
  std::vector<Vector6d> sent_;          // the delta that the cliques below were solved with
  std::vector<char> moved_;             // in the solve that is going on
  std::vector<std::uint32_t> local_;    // scratch, by pose: index among the poses at hand
  std::vector<std::uint32_t> slot_of_;  // scratch, by pose: slot in the front at hand
  double last_cost_ = 0;
  std::size_t last_poses_ = 0;
  int singular_ = 0;
};

}  // namespace hybrid_slam
