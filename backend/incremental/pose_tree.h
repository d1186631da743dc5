#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "backend/incremental/front.h"
#include "backend/map/keyframe_covariances.h"

namespace hybrid_slam {

// The normal equations of a growing graph of poses, factored by block Cholesky as a tree of cliques
// (the Bayes tree of Kaess et al., iSAM2, IJRR 2012, in multifrontal form): each clique eliminates
// a few poses, and hands what that leaves on the poses it shares with the rest to its parent. When
// terms change, only the cliques of their poses and those above are factored anew, in a new order;
// the subtrees below keep what they handed up. What is said of poses here holds of every variable:
// others have tangents of other sizes.
//
// Solves H delta = -g. Knows no linearisation and no landmarks: terms bring their blocks.
class PoseTree {
 public:
  struct Options {
    std::size_t max_padding = 2;  // blocks of zeros in a clique, for fewer cliques
    // What a clique hands to its parent is most of the tree's memory, and needed only where the
    // parent is factored anew. Away from there one in so many levels keeps it, and what lies
    // between is factored again when it is asked for.
    int levels_kept = 32;
    // From so many rows of a separator on, cliques that were left as they are keep their factor in
    // single precision. It is solved for what differs from the separator's deltas by some 1e-7 of
    // these, which no observation tells. Smaller ones are little memory anyway.
    Eigen::Index narrow_from = 60;
    // How firmly a direction is held that no term determines: see refactor().
    double hold = 1e-9;
    // A variable that is no pose has changed once it moved by this share of its standard deviation
    // (given what is eliminated after it): no threshold in its units is needed.
    double share = 0.1;
    double shared_share = 0.3;  // the same of one that is shared
  };

  explicit PoseTree(const Options& options) : options_(options) {}

  // Poses are numbered from 0. A pose is part of the system once it was touched.
  void resize(std::size_t poses);
  // Adds a variable with a tangent of this size. One that is shared is eliminated after all others,
  // and TermSource::terms_of tells few of its terms.
  void add(std::size_t size, bool shared);

  // Cost of factoring anew what terms on these poses would touch, in multiplications; what is in
  // `marked` (a set of clique indices, kept by the caller between calls) is already paid for.
  double cost_of(std::span<const std::uint32_t> poses, std::vector<char>& marked) const;

  // The same where that costs no more than `most`, which is then less by it; else nothing is
  // marked.
  bool mark_up_to(double& most, std::span<const std::uint32_t> poses,
                  std::vector<char>& marked) const;

  // Whether factoring anew what is marked includes all terms on these poses.
  bool is_marked(std::span<const std::uint32_t> poses, const std::vector<char>& marked) const;

  // Factors anew: the terms on these poses changed, came or went. Poses in `newest` are eliminated
  // last. A pose that has no term left leaves the system; its delta stays as it is. A pivot that is
  // nothing but rounding, measured by what its terms added before elimination, tells that a
  // direction is not determined: it is held at its present delta.
  void refactor(const std::vector<std::uint32_t>& touched, const std::vector<std::uint32_t>& newest,
                const TermSource& terms);

  // Substitutes back from the root down to where no delta changes by more than `threshold` any
  // more. Appends the poses whose delta changed by more than that to `changed`.
  void solve(double threshold, std::vector<std::uint32_t>& changed);

  // Takes the last solve back: all deltas are what they were. The next one looks at them anew.
  void undo_solve();

  // Levenberg and Marquardt: from its next factorisation on, a pose's present delta counts as
  // measured with `weight` times the information that its terms give it. 0: not.
  void set_damping(std::uint32_t pose, double weight) { damping_[pose] = weight; }

  Eigen::Map<const Vector6d> delta(std::uint32_t pose) const {
    return Eigen::Map<const Vector6d>(delta_.data() + offset_[pose]);
  }
  Eigen::Map<const Eigen::VectorXd> delta_of(std::uint32_t variable) const {
    return {delta_.data() + offset_[variable], size(variable)};
  }
  Eigen::Index size(std::uint32_t variable) const { return size_[variable]; }

  // A variable that no clique has is as new again: its delta and damping are 0. False, and nothing
  // is done, if one has it still.
  bool renew(std::uint32_t variable);

  // Moves a pose by as much, whatever the system says. The next solve tells what changes against
  // that.
  void shift(std::uint32_t pose, const Vector6d& by);

  // Of a pose's delta: its block of H^-1. Looks at the pose's clique and those above.
  Matrix6d covariance(std::uint32_t pose) const { return covariance(std::span(&pose, 1)); }
  // Of the deltas of several variables together, in this order; distinct. What is not part of the
  // system has zeros.
  Eigen::MatrixXd covariance(std::span<const std::uint32_t> variables) const;

  // The cliques of these variables and all above them, as they are now. Once they have `most`
  // numbers no further variable's are taken; the first one's are always. What is not part of the
  // system has none.
  CholeskyPaths paths(std::span<const std::uint32_t> variables, std::size_t most) const;

  // By clique: how many are above it.
  std::vector<std::int32_t> depths() const;
  // The clique that eliminates the first of these variables, all of one term; none: negative.
  std::int32_t clique_of(std::span<const std::uint32_t> variables,
                         const std::vector<std::int32_t>& depths) const;

  std::size_t clique_count() const { return cliques_.size() - free_.size(); }
  double last_cost() const { return last_cost_; }  // of the last refactor, in multiplications
  std::size_t last_poses() const { return last_poses_; }
  int singular_cliques() const { return singular_; }  // ever met
  // Directions that no term determines, met in the last refactor.
  std::size_t last_undetermined() const { return last_undetermined_; }

 private:
  static constexpr std::int32_t kNone = -1;
  static constexpr std::size_t kAll = static_cast<std::size_t>(-1);

  struct Clique {
    std::vector<std::uint32_t> frontals;
    std::vector<std::uint32_t> separator;
    Eigen::MatrixXd factor;        // (f + s + 1) x f: [L11; L21; y^T], in rows of the tangents
    Eigen::MatrixXf narrow;        // the same in single precision, where that is kept alone
    Eigen::MatrixXd contribution;  // (s + 1) x s: what it hands to its parent; or not kept
    Eigen::VectorXd packed;        // its lower triangle, column by column, where that is kept alone
    Eigen::VectorXf scale;         // s: Front::add_scale of what it hands on
    std::int32_t parent = kNone;
    std::vector<std::int32_t> children;
    int height = 0;        // cliques below it, on the longest way down
    bool fresh = true;     // factored since it was last solved
    bool settled = false;  // those below it keep what they hand on in one level of some

    Eigen::Index frontal_rows() const { return factor.cols() + narrow.cols(); }
    Eigen::Index separator_rows() const { return scale.size(); }
  };

  Eigen::Index rows_of(const std::vector<std::uint32_t>& variables) const {
    Eigen::Index rows = 0;
    for (const std::uint32_t variable : variables) rows += size_[variable];
    return rows;
  }
  Eigen::Map<Eigen::VectorXd> values(std::vector<double>& of_all, std::uint32_t variable) const {
    return {of_all.data() + offset_[variable], size_[variable]};
  }
  bool is_shared(std::uint32_t variable) const { return shared_[variable] != 0; }
  Clique& at(std::int32_t i) { return cliques_[static_cast<std::size_t>(i)]; }
  const Clique& at(std::int32_t i) const { return cliques_[static_cast<std::size_t>(i)]; }

  // Poses that belong together: of terms, then of the separators of subtrees. They are listed once,
  // side by side: terms' own lists lie anywhere in memory.
  struct Groups {
    std::vector<std::uint32_t> terms;
    std::vector<std::uint32_t> members;    // by their places among the poses at hand
    std::vector<std::size_t> first = {0};  // of each group's members; and the number of all

    std::size_t size() const { return first.size() - 1; }
    std::span<const std::uint32_t> of(std::size_t group) const {
      return std::span(members).subspan(first[group], first[group + 1] - first[group]);
    }
  };

  // The tree's shape: pose_tree.cpp.
  std::int32_t make_clique();
  std::vector<std::uint32_t> detach(const std::vector<std::uint32_t>& touched,
                                    std::vector<std::int32_t>& orphans);
  Groups groups_inside(const std::vector<std::uint32_t>& poses,
                       const std::vector<std::int32_t>& orphans, const TermSource& terms);
  std::vector<std::uint32_t> own_terms(const Clique& clique, const TermSource& terms) const;
  static std::vector<std::vector<std::uint32_t>> adjacency_of(std::size_t poses,
                                                              const Groups& groups);
  std::vector<std::int32_t> build_cliques(const std::vector<std::uint32_t>& poses,
                                          const Groups& groups,
                                          const std::vector<std::uint32_t>& newest);
  std::vector<std::vector<std::uint32_t>> attach(const std::vector<std::uint32_t>& poses,
                                                 const std::vector<std::int32_t>& made,
                                                 const Groups& groups,
                                                 const std::vector<std::int32_t>& orphans);

  // Its factors: tree_factorization.cpp.
  static double factor_cost(Eigen::Index frontals, Eigen::Index separator);
  void factor(std::int32_t index, const std::vector<std::uint32_t>& own, const TermSource& terms);
  Front assemble(const Clique& clique, const std::vector<std::uint32_t>& own,
                 const TermSource& terms);
  void add_contribution(const Clique& child, Front& front) const;
  void damp(const Clique& clique, Front& front) const;
  void eliminate_frontals(Clique& clique, Front& front);
  void factor_frontals(Clique& clique, Front& front);
  std::size_t factor_held(Clique& clique, Front& front) const;
  void restore_contribution(std::int32_t index, const TermSource& terms);
  void settle(std::int32_t index);
  void forget_contributions(const Clique& clique);
  void narrow(Clique& clique) const;
  static const Eigen::MatrixXd& factor_of(const Clique& clique, Eigen::MatrixXd& scratch);
  static void pack(Clique& clique);
  static void unpack(Clique& clique);

  // Its solution: tree_solution.cpp.
  void solve_clique(Clique& clique, double threshold, std::vector<std::uint32_t>& changed);
  Eigen::VectorXd right_side(const Clique& clique, const Eigen::MatrixXd& factor) const;
  Eigen::Index solve_shared(const Clique& clique, const Eigen::MatrixXd& factor, double threshold,
                            Eigen::VectorXd& right);
  void take(const Clique& clique, const Eigen::MatrixXd& factor, const Eigen::VectorXd& solved,
            double threshold, std::vector<std::uint32_t>& changed);
  bool has_changed(const Eigen::MatrixXd& factor, std::uint32_t variable, Eigen::Index row,
                   double threshold) const;

  // Covariances: tree_covariance.cpp.
  std::vector<std::int32_t> paths_to_roots(std::span<const std::uint32_t> variables,
                                           std::size_t most = kAll) const;

  Options options_;
  std::vector<Clique> cliques_;
  std::vector<std::int32_t> free_;
  std::vector<std::int32_t> clique_of_;  // by pose
  std::vector<std::uint32_t> size_;      // of tangents
  std::vector<std::size_t> offset_;      // into delta_ and sent_
  std::vector<char> is_pose_;
  std::vector<char> shared_;
  bool any_shared_ = false;
  bool all_poses_ = true;
  std::vector<double> delta_;
  std::vector<double> sent_;  // the deltas that the cliques below were solved with
  std::vector<char> moved_;   // in the solve that is going on
  std::vector<double> damping_;
  // Of the last solve: its variables, and what their deltas and what was sent were before.
  std::vector<std::uint32_t> solved_variables_;
  std::vector<double> before_;
  std::vector<std::int32_t> solved_;      // cliques of the last solve
  std::vector<std::uint32_t> local_;      // scratch, by pose: index among the poses at hand
  std::vector<std::uint32_t> slot_of_;    // scratch, by pose: slot in the front at hand
  std::vector<std::uint32_t> looked_at_;  // scratch, by term: the last look for which it was
  std::uint32_t look_ = 0;
  Eigen::MatrixXd wide_;  // scratch: a factor that is kept in single precision
  double last_cost_ = 0;
  std::size_t last_poses_ = 0;
  std::size_t last_undetermined_ = 0;
  int singular_ = 0;
};

}  // namespace hybrid_slam
