#include "backend/problem/problem_builder.h"

#include <ceres/cost_function.h>
#include <ceres/loss_function.h>
#include <ceres/problem.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "factors/make_reprojection_factor.h"
#include "factors/manifolds.h"

namespace hybrid_slam {

ProblemTerm::ProblemTerm() = default;
ProblemTerm::ProblemTerm(ProblemTerm&&) noexcept = default;
ProblemTerm& ProblemTerm::operator=(ProblemTerm&&) noexcept = default;
ProblemTerm::~ProblemTerm() = default;

namespace {

class Assembler {
 public:
  Assembler(const MapSnapshot& map, const ProblemConfig& config) : map_(map), config_(config) {}

  AssembledProblem assemble() {
    for (const KeyframeId id : config_.variable_poses) add_pose(id);
    problem_.variable_poses = problem_.poses.size();
    for (const KeyframeId id : config_.fixed_poses) add_pose(id);
    for (const LandmarkId id : config_.variable_landmarks) add_landmark(id, true);
    problem_.variable_points = problem_.points.size();
    for (const LandmarkId id : config_.fixed_landmarks) add_landmark(id, false);
    return std::move(problem_);
  }

 private:
  static constexpr std::uint32_t kAbsent = std::numeric_limits<std::uint32_t>::max();

  void add_pose(KeyframeId id) {
    const Keyframe* keyframe = map_.find(id);
    if (keyframe != nullptr) {
      if (index_of_.size() <= id.value) index_of_.resize(id.value + 1, kAbsent);
      index_of_[id.value] = static_cast<std::uint32_t>(problem_.poses.size());
    }
    keyframes_.push_back(keyframe);
    problem_.poses.push_back(keyframe != nullptr ? keyframe->cam_from_world : Rigid3d());
  }

  void add_landmark(LandmarkId id, bool variable) {
    const auto point = static_cast<std::uint32_t>(problem_.points.size());
    const Landmark* landmark = map_.find(id);
    problem_.points.push_back(landmark != nullptr ? landmark->point_in_world
                                                  : Eigen::Vector3d::Zero().eval());
    if (landmark == nullptr) return;
    for (const Observation& observation : landmark->observations) {
      const std::uint32_t keyframe = observation.keyframe.value;
      const std::uint32_t pose = keyframe < index_of_.size() ? index_of_[keyframe] : kAbsent;
      if (pose == kAbsent || (!variable && pose >= problem_.variable_poses)) continue;
      add_term(id, observation, pose, point);
    }
  }

  void add_term(LandmarkId id, const Observation& observation, std::uint32_t pose,
                std::uint32_t point) {
    const FrameObservations& frame = *keyframes_[pose]->observations;
    const Keypoint& keypoint = frame.features.keypoints[observation.keypoint];
    const bool stereo = frame.has_right(observation.keypoint);
    const double u_right = stereo ? frame.u_right[observation.keypoint] : kNoRightMatch;
    ProblemTerm term;
    term.factor = make_reprojection_factor(map_.camera(frame.camera),
                                           {keypoint.x, keypoint.y, u_right}, keypoint.sigma);
    term.landmark = id;
    term.observation = observation;
    term.pose = pose;
    term.point = point;
    term.stereo = stereo;
    problem_.terms.push_back(std::move(term));
  }

  const MapSnapshot& map_;
  const ProblemConfig& config_;
  AssembledProblem problem_;
  std::vector<const Keyframe*> keyframes_;  // as problem_.poses
  std::vector<std::uint32_t> index_of_;     // into problem_.poses, by the keyframe's id
};

}  // namespace

AssembledProblem assemble_problem(const MapSnapshot& map, const ProblemConfig& config) {
  return Assembler(map, config).assemble();
}

double chi2(const AssembledProblem& problem, const ProblemTerm& term) {
  const double* blocks[] = {problem.poses[term.pose].params.data(),
                            problem.points[term.point].data()};
  double residual[3] = {0, 0, 0};
  if (!term.factor->Evaluate(blocks, residual, nullptr)) {
    return std::numeric_limits<double>::infinity();
  }
  return residual[0] * residual[0] + residual[1] * residual[1] + residual[2] * residual[2];
}

std::unique_ptr<ceres::Problem> build_ceres_problem(AssembledProblem& assembled,
                                                    const ProblemOptions& options, bool robust) {
  ceres::Problem::Options ceres_options;
  ceres_options.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres_options.disable_all_safety_checks = true;  // blocks are rows of vectors of their own
  auto problem = std::make_unique<ceres::Problem>(ceres_options);
  // Owned by the problem, which frees a loss once however many terms share it.
  ceres::LossFunction* mono = nullptr;
  ceres::LossFunction* stereo = nullptr;
  std::vector<char> pose_used(assembled.poses.size(), 0);
  std::vector<char> point_used(assembled.points.size(), 0);
  for (ProblemTerm& term : assembled.terms) {
    if (!term.active) continue;
    ceres::LossFunction*& loss = term.stereo ? stereo : mono;
    if (robust && loss == nullptr) {
      loss = new ceres::HuberLoss(std::sqrt(term.stereo ? options.chi2_stereo : options.chi2_mono));
    }
    Rigid3d& pose = assembled.poses[term.pose];
    Eigen::Vector3d& point = assembled.points[term.point];
    if (!pose_used[term.pose]) {
      pose_used[term.pose] = 1;
      problem->AddParameterBlock(pose.params.data(), 7, new PoseManifold);
      if (term.pose >= assembled.variable_poses) {
        problem->SetParameterBlockConstant(pose.params.data());
      }
    }
    problem->AddResidualBlock(term.factor.get(), loss, pose.params.data(), point.data());
    if (!point_used[term.point] && term.point >= assembled.variable_points) {
      problem->SetParameterBlockConstant(point.data());
    }
    point_used[term.point] = 1;
  }
  return problem;
}

}  // namespace hybrid_slam
