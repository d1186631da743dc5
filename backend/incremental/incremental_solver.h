#pragma once

#include <memory>
#include <stop_token>
#include <vector>

#include "backend/incremental/edge_term.h"
#include "backend/incremental/landmark_term.h"
#include "backend/incremental/pose_tree.h"
#include "backend/incremental/prior_term.h"
#include "backend/incremental/robust_loss.h"
#include "backend/incremental/world_tangent.h"
#include "backend/problem/factor_graph.h"
#include "backend/problem/problem_config.h"

namespace ceres {
class CostFunction;
}

namespace hybrid_slam {

struct IncrementalOptions {
  // Terms are linearised anew when their residuals differ from what their linearisations predict
  // by more, in squares and together, than this fraction of the cost (which bounds how far the cost
  // is from its optimum), or when one term's do by more than `worst_mismatch` of a typical residual
  // (root mean square over all rows).
  double relinearization = 1e-4;
  double worst_mismatch = 0.5;
  // Back-substitution stops where a pose moves by less (metres, radians).
  double wildfire = 1e-5;
  int max_steps = 3;  // Gauss-Newton steps per update
  // Multiplications that relinearising old terms may cost per update, on average; what was not
  // spent is saved up for later ones, up to `burst` times as much. The rest waits its turn.
  double budget = 5e6;
  double burst = 3;
  Loss loss = Loss::kNone;  // of observations, at the square root of the threshold
  double chi2_mono = 5.991;
  double chi2_stereo = 7.815;
  Loss loop_loss = Loss::kNone;  // of edges that are loops, at the square root of their threshold
  double chi2_loop = 16.812;
  // Poses that stay in the system; older ones are marginalised: they and the landmarks they see are
  // minimised out, what that says about the others stays as a linear prior, and they no longer
  // move. A landmark that is seen again afterwards starts anew. What is left of a pose is about 300
  // bytes, of a landmark nothing once remove_point() was called. 0: all poses stay.
  int window = 0;

  std::string validate() const;
};

struct UpdateSummary {
  int steps = 0;
  int damped = 0;   // of the steps: those that would have raised the cost, and were shortened
  int refused = 0;  // of the steps: those that would have raised the cost however short
  bool stopped = false;
  std::size_t undetermined = 0;      // directions that no term determines, and that were held
  std::size_t poses = 0;             // factored anew, over all steps
  std::size_t relinearized = 0;      // terms
  std::size_t pending = 0;           // terms that wait to be linearised anew
  std::vector<std::uint32_t> moved;  // poses whose estimate changed, ascending
  std::vector<std::uint32_t> marginalized;  // poses that no longer move, from now on; ascending
  double multiplications = 0;               // of the factorisation
};

// Incremental smoothing of a graph that grows: see docs/backend.md. The graph persists: each term
// keeps its linearisation, landmarks are eliminated in their terms, and the poses are solved by a
// PoseTree, of which an update touches only what its terms concern. Gauss-Newton; the estimate of
// everything is at hand at any time. Steps are judged by the true cost, with the losses: none
// raises it by more than linearisations may be off.
class IncrementalSolver final : private TermSource {
 public:
  explicit IncrementalSolver(const IncrementalOptions& options);
  ~IncrementalSolver() override;

  // All return the index of what they add, counted from 0 per kind; that of a point or observation
  // which was removed, and of an observation that was marginalised, is used again. They throw
  // std::logic_error and add nothing if an index is out of range or a number cannot be used.
  std::uint32_t add_camera(const Camera& camera);
  std::uint32_t add_pose(const GraphFrame& frame);
  std::uint32_t add_point(const Eigen::Vector3d& in_world);
  std::uint32_t add_observation(const GraphObservation& observation);
  std::uint32_t add_edge(const GraphEdge& edge);
  void remove_observation(std::uint32_t observation);
  void remove_edge(std::uint32_t edge);
  void remove_point(std::uint32_t point);  // with its observations

  // The covariance of a pose's left perturbation, exp(d) * cam_from_world, given all that was taken
  // in; conditional on what is fixed.
  Matrix6d covariance(std::uint32_t pose) const;

  // Takes in what was added and removed since the last update. Looks at `stop` between steps; what
  // was left to do then waits for the next update.
  UpdateSummary update(const std::stop_token& stop = {});

  Rigid3d pose(std::uint32_t index) const;
  Eigen::Vector3d point(std::uint32_t index) const;
  std::size_t pose_count() const { return poses_.size(); }

  // Squared whitened residual of an observation that is there, at the present estimate; infinite if
  // the point does not project.
  double chi2(std::uint32_t observation) const;

  // The terms that are there, at the present estimate: for a batch solver.
  FactorGraph graph() const;

  // Half the sum of squares, without a loss, of all observations that project and of all edges at
  // the present estimate. Evaluates each.
  double cost() const;

 private:
  enum class TermKind : std::uint8_t { kEdge, kLandmark, kPrior };

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

  struct Pose {
    WorldTangent tangent;
    Rigid3d folded;  // the estimate when its delta was folded_delta
    Vector6d folded_delta = Vector6d::Zero();
    std::uint32_t camera = GraphFrame::kNoCamera;
    bool fixed = false;
    double damping = 0;  // see PoseTree::set_damping
    std::vector<std::uint32_t> terms;
  };

  std::span<const std::uint32_t> terms_of(std::uint32_t pose) const override;
  std::span<const std::uint32_t> poses_of(std::uint32_t term) const override;
  void assemble(std::uint32_t term, Front& front) const override;

  std::uint32_t free_observation();
  std::uint32_t add_term(TermKind kind, std::uint32_t index);
  void mark_dirty(std::uint32_t term);
  void linearize(std::uint32_t term);
  // These return the term's cost.
  double linearize_edge(std::uint32_t index);
  double linearize_landmark(std::uint32_t index);
  bool linearize_view(const Eigen::Vector3d& point, LandmarkView& view, double& cost) const;
  // A term's residual at the present estimate.
  struct Evaluation {
    double squared_norm = 0;      // of what the linearisation predicts: weighted
    double squared_mismatch = 0;  // of the difference to what its linearisation predicts
    double cost = 0;              // twice, with the losses
    int rows = 0;
  };
  RobustLoss edge_loss(std::uint32_t index) const;
  RobustLoss view_loss(const LandmarkView& view) const;
  Vector6d edge_residual(std::uint32_t index) const;
  Evaluation evaluate_edge(std::uint32_t index) const;
  Evaluation evaluate_landmark(std::uint32_t index) const;
  Evaluation evaluate_prior(std::uint32_t index) const;
  void evaluate(std::uint32_t term);
  void check(const std::vector<std::uint32_t>& linearized, const std::vector<std::uint32_t>& moved);
  std::size_t choose();
  double typical() const;

  // What a step may have to take back.
  struct Moved {
    std::uint32_t pose;
    Rigid3d folded;
    Vector6d folded_delta;
  };
  void step(UpdateSummary& summary);
  void solve_step(UpdateSummary& summary, const std::vector<std::uint32_t>& terms);
  void undo_step();
  bool is_higher() const;
  void hold_landmarks_back();
  void raise_damping();
  void relax_damping();

  LinearSystem rows_of_term(std::uint32_t term) const;
  void marginalize_poses(const std::vector<std::uint32_t>& poses);
  void add_prior(PriorTerm prior);
  void drop_term(std::uint32_t term);
  std::vector<std::uint32_t> slide_window();
  Vector6d delta(std::uint32_t pose) const;
  void fold(std::uint32_t pose);
  Eigen::Vector3d displacement(const LandmarkTerm& landmark) const;
  Eigen::Vector3d carried_base(const LandmarkTerm& landmark) const;

  IncrementalOptions options_;
  PoseTree tree_;
  std::vector<Camera> cameras_;
  std::vector<Pose> poses_;
  std::vector<Term> terms_;
  std::vector<GraphObservation> observations_;
  std::vector<char> observation_there_;
  std::vector<std::unique_ptr<ceres::CostFunction>> observation_factors_;
  std::vector<LandmarkTerm> landmarks_;
  std::vector<char> point_there_;
  std::vector<std::uint32_t> landmark_terms_;  // the term of a landmark
  std::vector<GraphEdge> edges_;
  std::vector<char> edge_there_;
  std::vector<std::unique_ptr<ceres::CostFunction>> edge_factors_;
  std::vector<EdgeTerm> edge_terms_;
  std::vector<std::uint32_t> edge_ids_;  // the term of an edge
  std::vector<PriorTerm> priors_;
  std::vector<std::uint32_t> free_observations_;  // indices that may be used again
  std::vector<std::uint32_t> free_points_;
  std::uint32_t oldest_ = 0;            // poses before it do not vary
  std::vector<std::uint32_t> dirty_;    // terms
  std::vector<std::uint32_t> touched_;  // poses whose terms changed
  std::vector<std::uint32_t> newest_;   // poses
  std::vector<std::uint32_t> pending_;  // terms
  std::uint64_t stamp_ = 0;
  double squared_norm_ = 0;  // of all terms
  double rows_ = 0;
  double mismatch_ = 0;  // of all terms, squared
  double credit_ = 0;    // multiplications
  // Of the step at hand.
  std::uint64_t step_ = 0;
  double rise_ = 0;                    // of the cost, twice
  std::vector<std::uint32_t> judged_;  // terms that were evaluated
  std::vector<Moved> moved_;
  std::vector<std::uint32_t> held_back_;  // landmarks
  std::vector<std::uint32_t> damped_;     // poses whose damping is not 0
};

}  // namespace hybrid_slam
