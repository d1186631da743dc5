#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "backend/problem/problem_config.h"

namespace ceres {
class CostFunction;
class Problem;
}  // namespace ceres

namespace hybrid_slam {

// One observation as a term of the cost.
struct ProblemTerm {
  ProblemTerm();
  ProblemTerm(ProblemTerm&&) noexcept;
  ProblemTerm& operator=(ProblemTerm&&) noexcept;
  ~ProblemTerm();

  std::unique_ptr<ceres::CostFunction> factor;
  LandmarkId landmark;
  Observation observation;
  std::uint32_t pose = 0;   // index into AssembledProblem::poses
  std::uint32_t point = 0;  // index into AssembledProblem::points
  bool stereo = false;      // three residuals, else two
  bool active = true;       // else set aside: beyond its threshold, or it does not project
};

// A config with the numbers of a map: the present estimate and a factor for each observation.
// Lives as long as its rounds, which set terms aside and move the estimate.
struct AssembledProblem {
  std::vector<Rigid3d> poses;  // the config's variable poses, then its fixed ones
  std::size_t variable_poses = 0;
  std::vector<Eigen::Vector3d> points;  // variable landmarks, then fixed ones
  std::size_t variable_points = 0;
  std::vector<ProblemTerm> terms;  // by landmark, then by keyframe
};

// Ids of the config that the map does not have are skipped by leaving their entries without terms.
AssembledProblem assemble_problem(const MapSnapshot& map, const ProblemConfig& config);

// Squared whitened residual of a term at the present estimate; infinite if it does not project.
double chi2(const AssembledProblem& problem, const ProblemTerm& term);

// The active terms, with Huber's loss if `robust`, as a Ceres problem on the estimate of `problem`,
// which must outlive it. Poses or points without an active term are not in it.
std::unique_ptr<ceres::Problem> build_ceres_problem(AssembledProblem& problem,
                                                    const ProblemOptions& options, bool robust);

}  // namespace hybrid_slam
