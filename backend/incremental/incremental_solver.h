#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

#include "backend/incremental/block.h"
#include "backend/incremental/condensation_groups.h"
#include "backend/incremental/condensed_term.h"
#include "backend/incremental/edge_term.h"
#include "backend/incremental/incremental_options.h"
#include "backend/incremental/landmark_term.h"
#include "backend/incremental/pose_tree.h"
#include "backend/incremental/rows_term.h"
#include "backend/incremental/world_tangent.h"
#include "backend/problem/factor_graph.h"
#include "backend/problem/problem_config.h"
#include "backend/problem/robust_loss.h"

namespace ceres {
class CostFunction;
}

namespace hybrid_slam {

// Incremental smoothing of a graph that grows: see docs/backend.md. The graph persists: each term
// keeps its linearisation, landmarks are eliminated in their terms, and the poses are solved by a
// PoseTree, of which an update touches only what its terms concern. Gauss-Newton; the estimate of
// everything is at hand at any time. Steps are judged by the true cost, with the losses: none
// raises it by more than linearisations may be off.
class IncrementalSolver final : private TermSource {
 public:
  explicit IncrementalSolver(const IncrementalOptions& options);
  ~IncrementalSolver() override;

  // All return the index of what they add, counted from 0 per kind; that of a pose, point,
  // observation or edge which was removed, and of an observation that was marginalised, is used
  // again. They throw std::logic_error and add nothing if an index is out of range or a number
  // cannot be used.
  std::uint32_t add_camera(const Camera& camera);
  std::uint32_t add_pose(const GraphFrame& frame);
  std::uint32_t add_point(const Eigen::Vector3d& in_world);
  std::uint32_t add_observation(const GraphObservation& observation);
  std::uint32_t add_edge(const GraphEdge& edge);
  void remove_observation(std::uint32_t observation);
  void remove_edge(std::uint32_t edge);
  // A pose of which no term is left since the last update: its place is another one's from now on.
  // False if there is one, or if it cannot be: it is fixed, was removed, or poses make a window.
  bool remove_pose(std::uint32_t pose);
  void remove_point(std::uint32_t point);  // with its observations and factors

  // Variables and factors of any kind (backend/problem/graph_factor.h), by the same rules; indices
  // of what was removed are used again. A factor's residuals must be numbers at the present
  // estimate, or its function fail there: then it waits until it does not.
  std::uint32_t add_block(const GraphBlock& block);
  std::uint32_t add_factor(const GraphFactor& factor);
  void remove_factor(std::uint32_t factor);
  void remove_block(std::uint32_t block);  // with its factors

  // Whether a pose or a block varies, from the next update on. One that rides with a pose is fixed
  // in the world. What was marginalised stays fixed.
  void set_fixed(const GraphVariable& variable, bool fixed);

  // Poses and blocks leave the system: what their terms say about others stays, as a linear prior.
  // Landmarks of these poses are minimised out as well, and blocks that ride with them go, too.
  void marginalize(const std::vector<GraphVariable>& variables);

  // The estimate of these poses jumps: a loop was closed, or something else solved them. Points
  // follow. The next updates begin there: they linearise anew what this took off its linearisation
  // (terms between poses that moved as one rigid body stay as they are), and take back what the
  // terms do not agree with. Poses that are fixed, the window's
  // marginalised ones among them, must not be moved: std::logic_error, and nothing is done.
  void move_poses(const std::vector<std::pair<std::uint32_t, Rigid3d>>& cam_from_world);

  // The covariance of a pose's left perturbation, exp(d) * cam_from_world, given all that was taken
  // in; conditional on what is fixed.
  Matrix6d covariance(std::uint32_t pose) const;
  // The same of several variables together, in this order: 6 rows of a pose, 3 of a point, and as
  // many as it has values of a block, which on a manifold makes it singular. Zero of what does not
  // vary, NaN of a point that its views do not determine. The cost is that of the tree's way from
  // these variables to the root, of a point from all that see it.
  Eigen::MatrixXd covariance(const std::vector<GraphVariable>& variables) const;

  // For covariances of these poses, and of others that come with them, without the solver: of those
  // in `poses`, ascending by pose, that vary and have terms. `most`: see PoseTree::paths.
  struct PosePaths {
    struct Known {
      std::uint32_t pose = 0;
      std::uint32_t at = 0;  // its place in the paths' variables
      Matrix6d by_variable;  // derivative of its left perturbation
    };
    CholeskyPaths paths;
    std::vector<Known> poses;
  };
  PosePaths paths(const std::vector<std::uint32_t>& poses, std::size_t most) const;

  // Takes in what was added and removed since the last update. Looks at `stop` between steps, so
  // that every update makes one; what was left to do then waits for the next update.
  UpdateSummary update(const std::stop_token& stop = {});

  Rigid3d pose(std::uint32_t index) const;
  Eigen::Vector3d point(std::uint32_t index) const;
  // Changes no estimate: makes point() fast for this one and those condensed with it, as long as
  // the poses that see them keep their shape.
  void place(std::uint32_t point);
  // The same of these, and where they are.
  std::vector<Eigen::Vector3d> place(std::span<const std::uint32_t> points);
  Eigen::VectorXd block(std::uint32_t index) const;
  std::size_t pose_count() const { return poses_.size(); }
  std::size_t condensed_count() const { return condensed_count_; }  // points

  // Squared whitened residual of an observation that is there, at the present estimate; infinite if
  // the point does not project.
  double chi2(std::uint32_t observation) const;

  // The terms that are there, at the present estimate: for a batch solver.
  FactorGraph graph() const;

  // Half the sum of squares, without a loss, of all observations that project, of all edges and of
  // all factors at the present estimate. Evaluates each.
  double cost() const;

 private:
  enum class TermKind : std::uint8_t { kEdge, kLandmark, kPrior, kFactor, kCondensed };

  struct Term {
    TermKind kind = TermKind::kEdge;
    std::uint32_t index = 0;
    bool dirty = false;       // to be linearised in the next step
    bool pending = false;     // its linearisation is too old, and waits for its turn
    double mismatch = 0;      // squared, as of the last check
    double squared_norm = 0;  // of its weighted residual, when it was evaluated last
    double cost = 0;          // twice, with its losses, at the present estimate
    double start_cost = 0;    // the same before the step at hand
    int rows = 0;
    std::uint64_t checked = 0;  // stamp of the last check
    std::uint64_t step = 0;     // in which it was evaluated last
  };

  // What the tree solves for: a pose or a block. Terms know their variables by the number of these.
  struct Variable {
    bool is_block = false;
    std::uint32_t index = 0;  // of the pose or block
    bool fixed = false;
    bool gone = false;    // marginalised or removed
    bool shared = false;  // eliminated after all others
    double damping = 0;   // see PoseTree::set_damping
    std::vector<std::uint32_t> terms;
    std::vector<std::uint32_t> mixed;    // of a shared one: its terms that have others, too
    std::vector<std::uint32_t> dormant;  // of a fixed one: all its terms
  };

  // A GraphObservation in single precision: a hundred-thousandth of a pixel is no measurement, and
  // observations are most of what a survey is.
  struct Seen {
    std::uint32_t frame = 0;
    std::uint32_t point = 0;
    Eigen::Vector3f measurement = Eigen::Vector3f::Zero();
    float sigma = 1;

    GraphObservation given() const { return {frame, point, measurement.cast<double>(), sigma}; }
  };

  struct Pose {
    std::uint32_t variable = 0;
    WorldTangent tangent;
    Rigid3d folded;  // the estimate when its delta was folded_delta
    Vector6d folded_delta = Vector6d::Zero();
    std::uint32_t camera = GraphFrame::kNoCamera;
  };

  struct Factor {
    GraphFactor given;
    std::shared_ptr<const ceres::CostFunction> function;  // with left Jacobians
    bool there = false;
    std::uint32_t point = kNone;
    std::uint32_t term = kNone;
  };

  // What marginalised variables left on others; `active` is what is left of it once those that were
  // fixed since are put in.
  struct Prior {
    RowsTerm all;
    RowsTerm active;
  };

  static constexpr std::uint32_t kNone = GraphBlock::kNone;

  std::span<const std::uint32_t> terms_of(std::uint32_t variable) const override;
  bool has_terms(std::uint32_t variable) const override;
  std::span<const std::uint32_t> poses_of(std::uint32_t term) const override;
  void assemble(std::uint32_t term, Front& front) const override;
  const LandmarkTerm* landmark_at(std::span<const std::uint32_t> terms, std::size_t at) const;
  void fetch_poses(std::span<const std::uint32_t> terms, std::size_t at) const override;
  void fetch(std::span<const std::uint32_t> terms, std::size_t at) const override;

  std::uint32_t free_pose();
  std::uint32_t new_pose(bool fixed);
  std::uint32_t free_observation();
  std::uint32_t free_edge();
  std::uint32_t add_term(TermKind kind, std::uint32_t index);
  std::uint32_t add_variable(bool is_block, std::uint32_t index, bool fixed);
  void link(std::uint32_t variable, std::uint32_t term);
  void unlink(std::uint32_t variable, std::uint32_t term);
  void refresh(std::uint32_t term);
  std::vector<std::uint32_t> all_variables(const Factor& factor) const;
  std::vector<std::uint32_t> all_variables(const LandmarkTerm& landmark) const;
  std::vector<std::uint32_t> all_variables_of_term(std::uint32_t term) const;
  bool uses(const LandmarkTerm& landmark, std::uint32_t variable) const;
  void place_columns(const std::vector<std::uint32_t>& all, std::vector<std::uint32_t>& variables,
                     std::vector<Eigen::Index>& offsets) const;
  void put_fixed_in(Prior& prior) const;
  VariableSize size_of(const GraphVariable& variable) const;
  std::uint32_t variable_of(const GraphVariable& variable) const;
  void join_landmark(std::uint32_t factor);
  void leave_landmark(std::uint32_t factor);
  void mark_dirty(std::uint32_t term);
  void linearize(std::uint32_t term);
  // These return the term's cost.
  double linearize_edge(std::uint32_t index);
  double linearize_landmark(std::uint32_t index);
  double linearize(LandmarkTerm& landmark, const Eigen::Vector3d& at) const;
  bool linearize_view(const Eigen::Vector3d& point, LandmarkView& view, double& cost) const;
  // The residual of an observation, and its derivatives where they are not null.
  bool reproject(std::uint32_t observation, const Rigid3d& cam_from_world,
                 const Eigen::Vector3d& point, double* residual, double* d_pose = nullptr,
                 double* d_point = nullptr) const;
  int rows_of_observation(std::uint32_t observation) const;
  void fetch_change(std::span<const std::uint32_t> terms, std::size_t at) const;
  void fetch_measurements(std::span<const std::uint32_t> terms, std::size_t at) const;
  // A term's residual at the present estimate.
  struct Evaluation {
    double squared_norm = 0;      // of what the linearisation predicts: weighted
    double squared_mismatch = 0;  // of the difference to what its linearisation predicts
    double cost = 0;              // twice, with the losses
    int rows = 0;
  };
  RobustLoss edge_loss(std::uint32_t index) const;
  RobustLoss view_loss(std::uint32_t observation) const;
  RobustLoss loss_of_rows(int rows) const;  // of an observation
  Vector6d edge_residual(std::uint32_t index) const;
  // The same of factors of any kind. `point`: that of a landmark's, else null. False if the
  // function fails or gives what is not a number.
  class Arguments;
  double* write_value(const GraphVariable& variable, const Eigen::Vector3d* point,
                      double* to) const;
  bool factor_residual(const Factor& factor, const Eigen::Vector3d* point,
                       Eigen::Ref<Eigen::VectorXd> residual) const;
  bool linearize_factor(const Factor& factor, const Eigen::Vector3d* point,
                        const std::vector<std::uint32_t>& variables,
                        const std::vector<Eigen::Index>& offsets, LinearSystem& rows,
                        Eigen::Matrix<double, Eigen::Dynamic, 3>* by_point, double& cost) const;
  double linearize_rows(std::uint32_t factor);
  Evaluation evaluate_edge(std::uint32_t index) const;
  Evaluation evaluate_landmark(std::uint32_t index) const;
  Evaluation evaluate_prior(std::uint32_t index) const;
  Evaluation evaluate_condensed(std::uint32_t index);
  Evaluation evaluate_rows(std::uint32_t factor) const;
  void evaluate_factor_view(const FactorView& view, const Eigen::Vector3d& at,
                            const Eigen::Vector3d& displacement, Evaluation& result) const;
  void evaluate(std::uint32_t term);
  // backend/incremental/landmark_change.cpp
  void note_reach(LandmarkTerm& landmark) const;
  void note_evaluated(LandmarkTerm& landmark) const;
  bool has_changed(const LandmarkTerm& landmark) const;
  bool has_changed(const CondensedTerm& term) const;
  bool has_changed(const Term& term) const;
  void check(const std::vector<std::uint32_t>& linearized, const std::vector<std::uint32_t>& moved);
  std::size_t choose(bool again);
  bool choose_near(double limit, std::vector<std::uint32_t>& chosen);
  void take_pending(std::uint32_t id);
  std::size_t settle_moves();
  double typical() const;

  // What a step may have to take back.
  struct Moved {
    std::uint32_t variable;
    Rigid3d folded;
    Vector6d folded_delta;
  };
  struct MovedBlock {
    std::uint32_t variable;
    Eigen::VectorXd inner;
    Eigen::VectorXd folded_delta;
    Eigen::MatrixXd basis;
  };
  void step(UpdateSummary& summary);
  void solve_step(UpdateSummary& summary, const std::vector<std::uint32_t>& terms);
  void undo_step();
  bool is_higher() const;
  void hold_landmarks_back();
  void raise_damping();
  void relax_damping();

  // backend/incremental/condensation.cpp
  void condense_old();
  bool is_old(std::uint32_t point, std::uint32_t recent);
  std::vector<KnownGroup> known_groups(const std::vector<CondensableLandmark>& landmarks,
                                       const std::vector<std::int32_t>& depths) const;
  void condense(const CondensedGroup& group);
  std::uint32_t free_condensed();
  void move_into(CondensedTerm& term, std::uint32_t point);
  // backend/incremental/condensed_landmarks.cpp
  void take_apart(std::uint32_t index);
  void take_apart(const std::vector<std::uint32_t>& terms);
  LandmarkTerm& live(std::uint32_t point);
  double linearize_condensed(std::uint32_t index);
  Eigen::VectorXd deltas_of(const std::vector<std::uint32_t>& poses) const;
  std::vector<Eigen::Vector3d> places_of(const std::vector<std::uint32_t>& poses) const;
  Vector6d common_motion(const CondensedTerm& term, const Eigen::VectorXd& since) const;
  Eigen::VectorXd deltas_before(const std::vector<std::uint32_t>& poses, const CondensedTerm& term,
                                const Eigen::VectorXd& since) const;
  std::vector<double> shape_change(const CondensedTerm& term, const Eigen::VectorXd& since) const;
  bool is_still(const CondensedTerm& term, const Eigen::VectorXd& since) const;
  Eigen::Vector3d kept_place(const CondensedTerm::Member& member) const;
  std::optional<Eigen::Vector3d> best_place(const CondensedTerm& term, std::size_t member) const;
  LandmarkTerm taken_out(const CondensedTerm& term, std::size_t member) const;
  std::size_t member_of(std::uint32_t point) const;
  LandmarkTerm linearized_landmark(std::uint32_t point) const;
  Eigen::Vector3d condensed_point(std::uint32_t point) const;

  LinearSystem rows_of_term(std::uint32_t term) const;
  LinearSystem rows_of(const LandmarkTerm& landmark) const;
  void marginalize_variables(const std::vector<std::uint32_t>& variables);
  void add_prior(RowsTerm prior);
  void drop_term(std::uint32_t term);
  void forget_sums(std::uint32_t term);
  std::vector<std::uint32_t> slide_window();
  GraphPrior exported(const RowsTerm& prior) const;
  Pose& pose_with(std::uint32_t variable) { return poses_[variables_[variable].index]; }
  const Pose& pose_with(std::uint32_t variable) const { return poses_[variables_[variable].index]; }
  Rigid3d pose_at(std::uint32_t variable) const;
  struct Dependence;
  Dependence dependence_of(const GraphVariable& variable) const;
  Eigen::Matrix3d carrier_rotation(const Block& block) const;
  void fold(std::uint32_t variable);
  Eigen::Vector3d displacement(const LandmarkTerm& landmark) const;
  Eigen::Vector3d displaced(const LandmarkTerm& landmark,
                            const Eigen::Vector3d& displacement) const;
  Eigen::Vector3d carried_base(const LandmarkTerm& landmark) const;

  IncrementalOptions options_;
  PoseTree tree_;
  std::vector<Variable> variables_;
  std::vector<Camera> cameras_;
  std::vector<Pose> poses_;
  std::vector<Term> terms_;
  std::deque<Seen> observations_;  // grows without being copied
  std::vector<char> observation_there_;
  std::vector<std::unique_ptr<LandmarkTerm>> landmarks_;  // none of those that are condensed
  std::vector<char> point_there_;
  std::vector<std::uint32_t> landmark_terms_;  // the term of a landmark
  std::vector<std::uint32_t> condensed_in_;    // the condensed term that has it, or kNone
  std::vector<std::uint32_t> live_points_;     // that may not be condensed
  std::vector<CondensedTerm> condensed_;
  std::vector<std::uint32_t> condensed_ids_;  // the term of each
  std::vector<std::uint32_t> free_condensed_;
  std::vector<std::uint32_t> free_terms_;
  std::size_t next_condensation_ = 0;  // at so many poses
  std::size_t condensed_count_ = 0;    // points
  std::vector<GraphEdge> edges_;
  std::vector<char> edge_there_;
  std::vector<std::unique_ptr<ceres::CostFunction>> edge_factors_;
  std::vector<EdgeTerm> edge_terms_;
  std::vector<std::uint32_t> edge_ids_;  // the term of an edge
  std::vector<Prior> priors_;
  std::vector<Block> blocks_;
  std::vector<Factor> factors_;
  std::vector<RowsTerm> factor_terms_;      // of factors without a point
  std::vector<std::uint32_t> free_blocks_;  // indices that may be used again
  std::vector<std::uint32_t> free_factors_;
  std::vector<std::uint32_t> free_observations_;  // indices that may be used again
  std::vector<std::uint32_t> free_poses_;
  std::vector<std::uint32_t> free_points_;
  std::vector<std::uint32_t> free_edges_;
  std::uint32_t oldest_ = 0;            // poses before it do not vary
  std::vector<std::uint32_t> dirty_;    // terms
  std::vector<std::uint32_t> touched_;  // variables whose terms changed
  std::vector<std::uint32_t> newest_;   // variables
  std::vector<std::uint32_t> jumped_;   // variables that were moved since the last update
  std::vector<std::uint32_t> pending_;  // terms
  std::uint64_t stamp_ = 0;
  double squared_norm_ = 0;  // of all terms
  double rows_ = 0;
  double mismatch_ = 0;        // of all terms, squared
  double credit_ = 0;          // multiplications
  std::size_t evaluated_ = 0;  // rows, in this update
  // Of the step at hand.
  std::uint64_t step_ = 0;
  double rise_ = 0;                    // of the cost, twice
  std::vector<std::uint32_t> judged_;  // terms that were evaluated
  std::vector<Moved> moved_;
  std::vector<MovedBlock> moved_blocks_;
  std::vector<std::uint32_t> held_back_;  // landmarks
  std::vector<std::uint32_t> damped_;     // variables whose damping is not 0
};

}  // namespace hybrid_slam
