#include "test/backend/truth_check.h"

#include <ceres/cost_function.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <map>

#include "cameras/geometry/se3.h"
#include "factors/make_reprojection_factor.h"

namespace hybrid_slam {

namespace {

using Rows7 = Eigen::Matrix<double, Eigen::Dynamic, 7, Eigen::RowMajor>;
using Rows3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

struct Linearised {
  Eigen::VectorXd residual;
  Eigen::MatrixXd d_pose;
  Eigen::MatrixXd d_point;
};

class Checker {
 public:
  Checker(const SyntheticScene& scene, const FilledMap& filled, std::size_t fixed)
      : scene_(scene), filled_(filled), view_(filled.map.view()), fixed_(fixed) {
    for (std::size_t i = 0; i < filled.keyframes.size(); ++i) place_of_[filled.keyframes[i]] = i;
    const auto size = static_cast<Eigen::Index>(6 * (filled.keyframes.size() - fixed));
    information_.setZero(size, size);
  }

  TruthCheck check() {
    double unknowns = static_cast<double>(information_.rows());
    for (std::size_t i = 0; i < filled_.landmarks.size(); ++i) {
      const LandmarkId id = filled_.landmarks[i];
      if (!id.valid() || view_.find(id) == nullptr) continue;
      add_landmark(view_.at(id), scene_.points_in_world[i]);
      unknowns += 3;
    }
    TruthCheck result;
    result.freedom = static_cast<std::size_t>(information_.rows());
    const Eigen::VectorXd error = pose_errors();
    result.nees = error.dot(information_ * error) / static_cast<double>(result.freedom);
    result.residual_freedom = residuals_ - unknowns;
    result.variance = squares_ / result.residual_freedom;
    for (Eigen::Index i = 0; i < error.size(); i += 6) {
      result.worst_translation = std::max(result.worst_translation, error.segment<3>(i).norm());
    }
    return result;
  }

 private:
  Linearised linearise(const Observation& observation, const Rigid3d& pose,
                       const Eigen::Vector3d& point) const {
    const FrameObservations& frame = *view_.at(observation.keyframe).observations;
    const Keypoint& keypoint = frame.features.keypoints[observation.keypoint];
    const double u_right =
        frame.u_right.empty() ? kNoRightMatch : frame.u_right[observation.keypoint];
    const auto factor = make_reprojection_factor(view_.camera(frame.camera),
                                                 {keypoint.x, keypoint.y, u_right}, keypoint.sigma);
    const int rows = factor->num_residuals();
    Eigen::VectorXd residual(rows);
    Rows7 d_pose(rows, 7);
    Rows3 d_point(rows, 3);
    const double* blocks[] = {pose.params.data(), point.data()};
    double* jacobians[] = {d_pose.data(), d_point.data()};
    if (!factor->Evaluate(blocks, residual.data(), jacobians)) {
      throw std::logic_error("an observation in the map does not project");
    }
    return {residual, d_pose.leftCols<6>(), d_point};
  }

  // Adds the landmark's information on the poses at the truth, the landmark itself marginalised.
  void add_landmark(const Landmark& landmark, const Eigen::Vector3d& truth) {
    Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
    std::vector<std::pair<Eigen::Index, Eigen::Matrix<double, 6, 3>>> coupling;
    for (const Observation& observation : landmark.observations) {
      const std::size_t place = place_of_.at(observation.keyframe);
      const SyntheticFrame& frame = scene_.frames[filled_.frames[place]];
      if (frame.outlier[observation.keypoint]) continue;
      const Keyframe& keyframe = view_.at(observation.keyframe);
      squares_ += linearise(observation, keyframe.cam_from_world, landmark.point_in_world)
                      .residual.squaredNorm();
      const Linearised at_truth = linearise(observation, frame.cam_from_world, truth);
      residuals_ += static_cast<double>(at_truth.residual.size());
      own += at_truth.d_point.transpose() * at_truth.d_point;
      if (place < fixed_) continue;
      const auto row = static_cast<Eigen::Index>(6 * (place - fixed_));
      information_.block<6, 6>(row, row) += at_truth.d_pose.transpose() * at_truth.d_pose;
      coupling.emplace_back(row, at_truth.d_pose.transpose() * at_truth.d_point);
    }
    if (coupling.empty()) return;
    const Eigen::LDLT<Eigen::Matrix3d> factored(own);
    for (const auto& [row, a] : coupling) {
      for (const auto& [col, b] : coupling) {
        information_.block<6, 6>(row, col) -= a * factored.solve(b.transpose());
      }
    }
  }

  Eigen::VectorXd pose_errors() const {
    Eigen::VectorXd errors(information_.rows());
    for (std::size_t i = fixed_; i < filled_.keyframes.size(); ++i) {
      const Rigid3d& truth = scene_.frames[filled_.frames[i]].cam_from_world;
      errors.segment<6>(static_cast<Eigen::Index>(6 * (i - fixed_))) =
          se3_log(view_.at(filled_.keyframes[i]).cam_from_world * inverse(truth));
    }
    return errors;
  }

  const SyntheticScene& scene_;
  const FilledMap& filled_;
  const MapSnapshot& view_;
  std::size_t fixed_;
  std::map<KeyframeId, std::size_t> place_of_;
  Eigen::MatrixXd information_;
  double squares_ = 0;
  double residuals_ = 0;
};

}  // namespace

TruthCheck check_truth(const SyntheticScene& scene, const FilledMap& filled, std::size_t fixed) {
  return Checker(scene, filled, fixed).check();
}

std::size_t count_wrong(const SyntheticScene& scene, const FilledMap& filled,
                        std::size_t min_observations) {
  const MapSnapshot& view = filled.map.view();
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < filled.keyframes.size(); ++i) {
    const auto& landmarks = view.at(filled.keyframes[i]).landmarks;
    for (std::size_t k = 0; k < landmarks.size(); ++k) {
      if (!landmarks[k].valid() || !scene.frames[filled.frames[i]].outlier[k]) continue;
      if (view.at(landmarks[k]).observations.size() >= min_observations) ++wrong;
    }
  }
  return wrong;
}

std::size_t count_observations(const MapSnapshot& map) {
  std::size_t count = 0;
  for (const LandmarkId id : map.landmark_ids()) count += map.at(id).observations.size();
  return count;
}

}  // namespace hybrid_slam
