#pragma once

#include <string>
#include <utility>
#include <vector>

#include "backend/map/ids.h"
#include "backend/map/map_edit.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// One run of the solver. Before the next round the observations are tested anew, and those beyond
// their chi2 threshold set aside.
struct SolveRound {
  int iterations = 10;
  bool robust = false;               // Huber's loss, at the square root of the chi2 threshold
  double function_tolerance = 1e-6;  // ends below this relative decrease of the cost
};

struct ProblemOptions {
  std::vector<SolveRound> rounds{{5, true, 1e-3}, {10, false, 1e-5}};
  double chi2_mono = 5.991;    // 95 %, 2 degrees of freedom
  double chi2_stereo = 7.815;  // 95 %, 3 degrees of freedom
  int max_dense_poses = 60;    // up to so many the reduced camera system is solved dense
  int threads = 1;             // inside the solver; more than 1 gives up repeatability

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// An optimisation problem, as a value: which poses and landmarks vary, and which are known. Its
// residuals are the observations of these landmarks in these keyframes, whatever their cameras,
// without those where nothing varies. The gauge is held by what is fixed. Every list ascends.
struct ProblemConfig {
  std::vector<KeyframeId> variable_poses;
  std::vector<KeyframeId> fixed_poses;
  std::vector<LandmarkId> variable_landmarks;
  std::vector<LandmarkId> fixed_landmarks;
  ProblemOptions options;
};

enum class SolveEnd {
  kConverged,       // the cost no longer decreases
  kIterationLimit,  // as many iterations as the rounds allow
  kStopped,         // on request
  kEmpty,           // nothing varies or nothing was observed
  kFailed,          // no usable result: poses and points stay as they were
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
  std::vector<LandmarkObservation> outliers;
  BundleSummary summary;
};

}  // namespace hybrid_slam
