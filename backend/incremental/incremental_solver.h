#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "backend/incremental/edge_term.h"
#include "backend/incremental/landmark_term.h"
#include "backend/incremental/pose_tree.h"
#include "backend/incremental/prior_term.h"
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
  std::size_t poses = 0;                    // factored anew, over all steps
  std::size_t relinearized = 0;             // terms
  std::size_t pending = 0;                  // terms that wait to be linearised anew
  std::vector<std::uint32_t> moved;         // poses whose estimate changed, ascending
  std::vector<std::uint32_t> marginalized;  // poses that no longer move, from now on; ascending
  double multiplications = 0;               // of the factorisation
};

// Incremental smoothing of a graph that grows: see docs/backend.md. The graph persists: each term
// keeps its linearisation, landmarks are eliminated in their terms, and the poses are solved by a
// PoseTree, of which an update touches only what its terms concern. Gauss-Newton; the estimate of
// everything is at hand at any time.
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

  // The estimate of these poses jumps: a loop was closed, or something else solved them. Points
  // follow. The next updates begin there: they linearise anew what this took off its linearisation
  // (terms between poses that moved as one rigid body stay as they are), and take back what the
  // terms do not agree with. Poses that are fixed, the window's
  // marginalised ones among them, must not be moved: std::logic_error, and nothing is done.
  void move_poses(const std::vector<std::pair<std::uint32_t, Rigid3d>>& cam_from_world);

  // The covariance of a pose's left perturbation, exp(d) * cam_from_world, given all that was taken
  // in; conditional on what is fixed.
  Matrix6d covariance(std::uint32_t pose) const;

  // Takes in what was added and removed since the last update.
  UpdateSummary update();

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
    int rows = 0;
    std::uint64_t checked = 0;  // stamp of the last check
  };

  struct Pose {
    WorldTangent tangent;
    Rigid3d folded;  // the estimate when its delta was folded_delta
    Vector6d folded_delta = Vector6d::Zero();
    std::uint32_t camera = GraphFrame::kNoCamera;
    bool fixed = false;
    std::vector<std::uint32_t> terms;
  };

  std::span<const std::uint32_t> terms_of(std::uint32_t pose) const override;
  std::span<const std::uint32_t> poses_of(std::uint32_t term) const override;
  void assemble(std::uint32_t term, Front& front) const override;

  std::uint32_t free_observation();
  std::uint32_t add_term(TermKind kind, std::uint32_t index);
  void mark_dirty(std::uint32_t term);
  void linearize(std::uint32_t term);
  void linearize_edge(std::uint32_t index);
  void linearize_landmark(std::uint32_t index);
  bool linearize_view(const Eigen::Vector3d& point, LandmarkView& view) const;
  // A term's residual at the present estimate.
  struct Evaluation {
    double squared_norm = 0;      // of what the linearisation predicts: weighted
    double squared_mismatch = 0;  // of the difference to what its linearisation predicts
    int rows = 0;
  };
  // The square roots of the weights that losses give, by which residuals and derivatives count.
  double edge_weight(std::uint32_t index, const Vector6d& residual) const;
  double view_weight(const LandmarkView& view, const Eigen::Vector3d& residual) const;
  Vector6d edge_residual(std::uint32_t index) const;
  Evaluation evaluate_edge(std::uint32_t index) const;
  Evaluation evaluate_landmark(std::uint32_t index) const;
  void evaluate(std::uint32_t term);
  void check(const std::vector<std::uint32_t>& linearized, const std::vector<std::uint32_t>& moved);
  std::size_t choose();
  std::size_t settle_moves();
  double typical() const;

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
  std::vector<std::uint32_t> jumped_;   // poses that were moved since the last update
  std::vector<std::uint32_t> pending_;  // terms
  std::uint64_t stamp_ = 0;
  double squared_norm_ = 0;  // of all terms
  double rows_ = 0;
  double mismatch_ = 0;  // of all terms, squared
  double credit_ = 0;    // multiplications
};

}  // namespace hybrid_slam
