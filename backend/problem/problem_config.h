#pragma once

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "backend/map/ids.h"
#include "backend/map/map_edit.h"
#include "backend/problem/loss.h"
#include "cameras/camera.h"
#include "cameras/geometry/sim3d.h"

namespace hybrid_slam {

// One run of the solver. Before the next round the observations are tested anew, and those beyond
// their chi2 threshold set aside.
struct SolveRound {
  int iterations = 10;
  Loss loss = Loss::kNone;           // of observations, at the square root of the chi2 threshold
  double function_tolerance = 1e-6;  // ends below this relative decrease of the cost
};

// All but kAuto: Ceres with this one.
enum class LinearSolver {
  kAuto,       // the bundle solver where it has the equations; else by size: problem_solver.cpp
  kDense,      // Schur complement, dense
  kSparse,     // Schur complement or, without landmarks, normal equations; sparse
  kIterative,  // Schur complement by conjugate gradients, never formed
};

struct ProblemOptions {
  std::vector<SolveRound> rounds{{5, Loss::kHuber, 1e-3}, {10, Loss::kNone, 1e-5}};
  double chi2_mono = 5.991;      // 95 %, 2 degrees of freedom
  double chi2_stereo = 7.815;    // 95 %, 3 degrees of freedom
  Loss loop_loss = Loss::kNone;  // of the edges that are loops, in every round
  double chi2_loop = 16.812;     // its threshold: 99 %, 6 degrees of freedom
  LinearSolver linear_solver = LinearSolver::kAuto;
  double trust_region = 1e4;  // radius at the start: large is nearly Gauss-Newton
  // 0 for none. Ends a round after the iteration in which it passes; gives up repeatability.
  double max_seconds = 0;
  int threads = 1;  // inside Ceres, not the bundle solver; more than 1 gives up repeatability

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// A measured or remembered motion between two keyframes, a term of a loop graph.
struct PoseConstraint {
  KeyframeId a;
  KeyframeId b;
  Sim3d a_from_b;                               // scale 1 unless the scale may have drifted
  Matrix7d information = Matrix7d::Identity();  // translation, rotation, log scale; in frame b
  bool loop = false;
};

// An optimisation problem, as a value: which poses and landmarks vary, and which are known. Its
// residuals are the observations of these landmarks in these keyframes, whatever their cameras,
// without those where nothing varies, and the constraints between these keyframes. The gauge is
// held by what is fixed. Every list of ids ascends.
struct ProblemConfig {
  std::vector<KeyframeId> variable_poses;
  std::vector<KeyframeId> fixed_poses;
  std::vector<LandmarkId> variable_landmarks;
  std::vector<LandmarkId> fixed_landmarks;
  std::vector<CameraId> refined_cameras;  // whose intrinsics vary, the baseline excepted
  std::vector<PoseConstraint> constraints;
  bool with_scale = false;  // poses as similarities: constraints only, no observations
  std::size_t window = 0;   // poses that vary at once (solve_windows.h); 0: all
  ProblemOptions options;
};

enum class SolveEnd {
  kConverged,       // the cost no longer decreases
  kIterationLimit,  // as many iterations as the rounds allow
  kStopped,         // on request
  kTimeLimit,
  kEmpty,   // nothing varies or nothing was observed
  kFailed,  // no usable result: poses and points stay as they were
};

struct BundleSummary {
  SolveEnd end = SolveEnd::kEmpty;
  std::string text;  // why it ended, for people
  // Half the squared whitened residuals of the observations that are kept, before and after.
  double initial_cost = 0;
  double final_cost = 0;
  int iterations = 0;
  int variable_poses = 0;
  int variable_landmarks = 0;
  int observations = 0;  // kept
  int outliers = 0;
  double seconds = 0;
};

// The solution: what varied, in the order of the config, and the observations beyond their
// threshold. `outliers` is empty unless all rounds were run. All values are finite.
struct BundleResult {
  std::vector<std::pair<KeyframeId, Rigid3d>> cam_from_world;
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> point_in_world;
  std::vector<std::pair<CameraId, Camera>> cameras;  // refined
  std::vector<LandmarkObservation> outliers;
  BundleSummary summary;
};

}  // namespace hybrid_slam
