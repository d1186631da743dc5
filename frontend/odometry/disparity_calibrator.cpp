#include "frontend/odometry/disparity_calibrator.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <vector>

#include <Eigen/Cholesky>

#include "frontend/pose/normal_equations.h"

namespace hybrid_slam {
namespace {

constexpr double kMedianChi2 = 2.366;   // of 3 degrees of freedom
constexpr double kOutlierChi2 = 7.815;  // 95 %, 3 degrees of freedom

using RowMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// One match, linearised: the residual in the current frame with the noise of both frames.
struct Linearized {
  Eigen::Vector3d residual;                             // predicted - measured (u, v, u_right)
  Eigen::Matrix<double, 3, 6, Eigen::RowMajor> motion;  // d residual / d motion
  Eigen::Vector3d offset;                               // d residual / d offset
  Eigen::Matrix3d weight;                               // inverse covariance
  double chi2 = 0;
};

class PairLinearizer {
 public:
  PairLinearizer(const Calibrated<RectifiedStereo>& camera, const Rigid3d& current_from_previous)
      : camera_(camera), motion_(current_from_previous) {}

  std::optional<Linearized> operator()(const Eigen::Vector3d& before, double sigma_before,
                                       const Eigen::Vector3d& now, double sigma_now) const {
    const auto point = triangulate_stereo(camera_, before);
    if (!point) return std::nullopt;
    const double* params = camera_.params.data();
    const Eigen::Vector3d moved = motion_ * *point;
    Eigen::Vector3d predicted;
    RowMatrix3d d_point;
    if (!RectifiedStereo::project_with_jacobians(params, moved.data(), predicted.data(),
                                                 d_point.data(), nullptr)) {
      return std::nullopt;
    }
    const Eigen::Matrix3d d_before =
        d_point * motion_.rotation().toRotationMatrix() * triangulation_jacobian(*point, before);
    Linearized match;
    match.residual = predicted - now;
    match.motion = pose_jacobian<3>(d_point, moved);
    match.offset = Eigen::Vector3d::UnitZ() - d_before.col(2);
    const Eigen::Matrix3d covariance =
        sigma_now * sigma_now * Eigen::Matrix3d::Identity() +
        sigma_before * sigma_before * d_before * d_before.transpose();
    match.weight = covariance.inverse();
    match.chi2 = match.residual.dot(match.weight * match.residual);
    return match;
  }

 private:
  // d point / d (u_left, v, u_right).
  Eigen::Matrix3d triangulation_jacobian(const Eigen::Vector3d& point,
                                         const Eigen::Vector3d& measured) const {
    const double disparity = measured[0] - measured[2];
    Eigen::Matrix3d jacobian;
    jacobian.col(0) = -point / disparity;
    jacobian.col(1).setZero();
    jacobian.col(2) = point / disparity;
    jacobian(0, 0) += point.z() / camera_.params[0];
    jacobian(1, 1) = point.z() / camera_.params[1];
    return jacobian;
  }

  const Calibrated<RectifiedStereo>& camera_;
  const Rigid3d& motion_;
};

double median_chi2(const std::vector<Linearized>& matches) {
  std::vector<double> chi2;
  for (const Linearized& match : matches) chi2.push_back(match.chi2);
  const auto middle = chi2.begin() + static_cast<long>(chi2.size() / 2);
  std::nth_element(chi2.begin(), middle, chi2.end());
  return *middle;
}

struct OffsetStep {
  double information = 0;
  double step = 0;
};

// The step of the offset with the motion eliminated; none where the motion is not determined.
std::optional<OffsetStep> eliminate_motion(const std::vector<Linearized>& matches,
                                           double variance) {
  Matrix6d motion = Matrix6d::Zero();
  Vector6d mixed = Vector6d::Zero();
  Vector6d motion_gradient = Vector6d::Zero();
  double offset = 0;
  double offset_gradient = 0;
  for (const Linearized& match : matches) {
    if (match.chi2 > kOutlierChi2 * variance) continue;
    const Eigen::Matrix3d weight = match.weight / variance;
    motion += match.motion.transpose() * weight * match.motion;
    mixed += match.motion.transpose() * weight * match.offset;
    motion_gradient += match.motion.transpose() * weight * match.residual;
    offset += match.offset.dot(weight * match.offset);
    offset_gradient += match.offset.dot(weight * match.residual);
  }
  const Eigen::LLT<Matrix6d> factor(motion);
  if (factor.info() != Eigen::Success) return std::nullopt;
  OffsetStep result;
  result.information = offset - mixed.dot(factor.solve(mixed));
  result.step = -(offset_gradient - mixed.dot(factor.solve(motion_gradient))) / result.information;
  if (!(result.information > 0) || !std::isfinite(result.step)) return std::nullopt;
  return result;
}

}  // namespace

std::string DisparityCalibratorOptions::validate() const {
  if (!(prior_sigma > 0)) return "prior_sigma must be positive";
  if (!(min_significance >= 0)) return "min_significance must not be negative";
  if (min_matches < 7) return "min_matches must be at least 7";
  return {};
}

DisparityCalibrator::DisparityCalibrator(const Calibrated<RectifiedStereo>& camera,
                                         const DisparityCalibratorOptions& options)
    : camera_(camera), options_(options) {
  const std::string error = options.validate();
  if (!error.empty()) throw std::invalid_argument("disparity calibrator: " + error);
  information_ = 1 / (options.prior_sigma * options.prior_sigma);
}

void DisparityCalibrator::add(const StereoFeatures& previous, double previous_correction,
                              const StereoFeatures& current, double current_correction,
                              const StereoMotion& motion) {
  if (!options_.enabled || static_cast<int>(motion.inliers.size()) < options_.min_matches) return;
  const double at = estimate();
  const auto measurement = [&](const StereoFeatures& features, int index, double correction) {
    const auto i = static_cast<std::size_t>(index);
    const Keypoint& left = features.left.keypoints[i];
    return Eigen::Vector3d(left.x, left.y, features.u_right[i] + correction - at);
  };
  const PairLinearizer linearize(camera_, motion.current_from_previous);
  std::vector<Linearized> matches;
  for (const CircularMatch& match : motion.inliers) {
    const auto linearized =
        linearize(measurement(previous, match.previous, previous_correction),
                  previous.left.keypoints[static_cast<std::size_t>(match.previous)].sigma,
                  measurement(current, match.current, current_correction),
                  current.left.keypoints[static_cast<std::size_t>(match.current)].sigma);
    if (linearized) matches.push_back(*linearized);
  }
  if (static_cast<int>(matches.size()) < options_.min_matches) return;
  const auto step = eliminate_motion(matches, median_chi2(matches) / kMedianChi2);
  if (step) {
    information_ += step->information;
    weighted_sum_ += step->information * (at + step->step);
  }
}

double DisparityCalibrator::offset() const {
  return std::abs(estimate()) > options_.min_significance * sigma() ? estimate() : 0;
}

double DisparityCalibrator::sigma() const { return 1 / std::sqrt(information_); }

}  // namespace hybrid_slam
