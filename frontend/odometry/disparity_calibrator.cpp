#include "frontend/odometry/disparity_calibrator.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>

#include "frontend/pose/damped_gauss_newton.h"

namespace hybrid_slam {
namespace {

constexpr double kMedianChi2 = 2.366;   // of 3 degrees of freedom
constexpr double kShareOfPair = 0.5;    // each frame, and its noise, is in two pairs
constexpr double kOutlierChi2 = 7.815;  // 95 %, 3 degrees of freedom

using RowMatrix3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Matrix73d = Eigen::Matrix<double, 7, 3>;

// What one match says of the motion (first six) and the offset (last), its point eliminated.
struct Contribution {
  Matrix7d information = Matrix7d::Zero();
  Vector7d gradient = Vector7d::Zero();
  double chi2 = 0;  // 3 degrees of freedom
};

// A point seen in both frames: six residuals (u, v, u_right twice), minimised over the point first.
// Linearising there, and not at the noisy measurement, keeps weights and noise independent: else
// the offset is biased wherever the noise is large.
class TwoFramePoint {
 public:
  TwoFramePoint(const Calibrated<RectifiedStereo>& camera, const Rigid3d& current_from_previous,
                const Eigen::Vector3d& before, double sigma_before, const Eigen::Vector3d& now,
                double sigma_now)
      : camera_(camera),
        motion_(current_from_previous),
        measured_{before, now},
        weight_{1 / (sigma_before * sigma_before), 1 / (sigma_now * sigma_now)} {}

  // None if no point is seen by both, or its residuals leave it open.
  std::optional<Contribution> eliminate() const {
    // Steps are in units of the depth, so that they are angles and shares.
    constexpr GaussNewtonStop kStop{10, 1e-6};  // a thousandth of a pixel at a focal length of 1000
    const auto start = triangulate_stereo(camera_, measured_[0]);
    if (!start) return std::nullopt;
    const auto minimum = damped_gauss_newton<3>(
        *start, [&](const Eigen::Vector3d& point) { return linearize(point, start->z()); },
        [&](const Eigen::Vector3d& step, const Eigen::Vector3d& point) -> Eigen::Vector3d {
          return point + start->z() * step;
        },
        kStop);
    return minimum ? eliminate(minimum->state) : std::nullopt;
  }

 private:
  struct View {
    Eigen::Vector3d in_cam;
    Eigen::Vector3d residual;
    RowMatrix3d d_in_cam;
    RowMatrix3d d_point;
  };

  // None if the camera does not see it.
  std::optional<View> view(int frame, const Eigen::Vector3d& point) const {
    View view;
    view.in_cam = frame == 0 ? point : motion_ * point;
    Eigen::Vector3d predicted;
    if (!RectifiedStereo::project_with_jacobians(camera_.params.data(), view.in_cam.data(),
                                                 predicted.data(), view.d_in_cam.data(), nullptr)) {
      return std::nullopt;
    }
    view.residual = predicted - measured_[frame];
    view.d_point = view.d_in_cam;
    if (frame == 1) view.d_point *= motion_.rotation().toRotationMatrix();
    return view;
  }

  // In the point alone, by steps in this unit.
  std::optional<NormalEquations<3>> linearize(const Eigen::Vector3d& point, double unit) const {
    NormalEquations<3> equations;
    for (int frame = 0; frame < 2; ++frame) {
      const std::optional<View> seen = view(frame, point);
      if (!seen) return std::nullopt;
      equations.add<3>(unit * seen->d_point, seen->residual, weight_[frame]);
      equations.cost += weight_[frame] * seen->residual.squaredNorm();
    }
    return equations;
  }

  std::optional<Contribution> eliminate(const Eigen::Vector3d& point) const {
    Contribution all;
    Matrix73d mixed = Matrix73d::Zero();
    Eigen::Matrix3d point_information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d point_gradient = Eigen::Vector3d::Zero();
    for (int frame = 0; frame < 2; ++frame) {
      const std::optional<View> seen = view(frame, point);
      if (!seen) return std::nullopt;
      Eigen::Matrix<double, 3, 7> d_unknowns = Eigen::Matrix<double, 3, 7>::Zero();
      if (frame == 1) d_unknowns.leftCols<6>() = pose_jacobian<3>(seen->d_in_cam, seen->in_cam);
      d_unknowns(2, 6) = 1;  // u_right without the offset is smaller
      const double weight = weight_[frame];
      all.information += weight * d_unknowns.transpose() * d_unknowns;
      all.gradient += weight * d_unknowns.transpose() * seen->residual;
      all.chi2 += weight * seen->residual.squaredNorm();
      mixed += weight * d_unknowns.transpose() * seen->d_point;
      point_information += weight * seen->d_point.transpose() * seen->d_point;
      point_gradient += weight * seen->d_point.transpose() * seen->residual;
    }
    const Eigen::LLT<Eigen::Matrix3d> factor(point_information);
    if (factor.info() != Eigen::Success) return std::nullopt;
    all.information -= mixed * factor.solve(mixed.transpose());
    all.gradient -= mixed * factor.solve(point_gradient);
    return all;
  }

  const Calibrated<RectifiedStereo>& camera_;
  const Rigid3d& motion_;
  Eigen::Vector3d measured_[2];
  double weight_[2];
};

double median_chi2(const std::vector<Contribution>& matches) {
  std::vector<double> chi2;
  for (const Contribution& match : matches) chi2.push_back(match.chi2);
  const auto middle = chi2.begin() + static_cast<long>(chi2.size() / 2);
  std::nth_element(chi2.begin(), middle, chi2.end());
  return *middle;
}

// Lamps that move along with the camera change what bumps look like, and hold features back by so
// much of their motion. Nothing at zero disparity, where the offset shows by itself.
constexpr double kMotionError = 0.002;

// What may shift the offset in every pair alike: noise of unknown ratio, and errors of the motion
// seen, from the farthest tenth of the points on to zero disparity.
double shift_by_model(std::vector<double> disparities, double noise_variance) {
  const auto count = static_cast<double>(disparities.size());
  double mean = 0;
  for (const double d : disparities) mean += d / count;
  double variance = 0;
  for (const double d : disparities) variance += (d - mean) * (d - mean) / count;
  const auto far = disparities.begin() + static_cast<long>(disparities.size() / 10);
  std::nth_element(disparities.begin(), far, disparities.end());
  return mean * noise_variance / std::max(variance, noise_variance) + kMotionError * *far;
}

struct OffsetStep {
  double information = 0;
  double step = 0;
};

// The step of the offset with the motion eliminated; none where the motion is not determined.
// `variance`: that of a whitened residual.
std::optional<OffsetStep> eliminate_motion(const std::vector<Contribution>& matches,
                                           double variance) {
  Contribution sum;
  for (const Contribution& match : matches) {
    if (match.chi2 > kOutlierChi2 * variance) continue;
    sum.information += match.information / variance;
    sum.gradient += match.gradient / variance;
  }
  const Eigen::LLT<Matrix6d> motion(sum.information.topLeftCorner<6, 6>());
  if (motion.info() != Eigen::Success) return std::nullopt;
  const Vector6d mixed = sum.information.topRightCorner<6, 1>();
  OffsetStep result;
  result.information = sum.information(6, 6) - mixed.dot(motion.solve(mixed));
  result.step =
      -(sum.gradient[6] - mixed.dot(motion.solve(sum.gradient.head<6>()))) / result.information;
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
                                         const DisparityCalibratorOptions& options,
                                         const std::optional<FoundParameter>& start)
    : camera_(camera),
      options_(options),
      estimate_(options.prior_sigma, kShareOfPair, options.min_significance,
                options.enabled ? start : std::nullopt) {
  const std::string error = options.validate();
  if (!error.empty()) throw std::invalid_argument("disparity calibrator: " + error);
}

void DisparityCalibrator::add(const StereoFeatures& previous, double previous_correction,
                              const StereoFeatures& current, double current_correction,
                              const StereoMotion& motion) {
  if (!options_.enabled || static_cast<int>(motion.inliers.size()) < options_.min_matches) return;
  const double at = estimate_.value_now();
  const auto measurement = [&](const StereoFeatures& features, int index, double correction) {
    const auto i = static_cast<std::size_t>(index);
    const Keypoint& left = features.left.keypoints[i];
    return Eigen::Vector3d(left.x, left.y, features.u_right[i] + correction - at);
  };
  std::vector<Contribution> matches;
  std::vector<double> disparities;
  double squared_sigma = 0;
  for (const CircularMatch& match : motion.inliers) {
    const auto contribution =
        TwoFramePoint(camera_, motion.current_from_previous,
                      measurement(previous, match.previous, previous_correction),
                      previous.left.keypoints[static_cast<std::size_t>(match.previous)].sigma,
                      measurement(current, match.current, current_correction),
                      current.left.keypoints[static_cast<std::size_t>(match.current)].sigma)
            .eliminate();
    if (!contribution) continue;
    matches.push_back(*contribution);
    const Eigen::Vector3d before = measurement(previous, match.previous, previous_correction);
    disparities.push_back(before.x() - before.z());
    const double sigma = previous.left.keypoints[static_cast<std::size_t>(match.previous)].sigma;
    squared_sigma += sigma * sigma;
  }
  if (static_cast<int>(matches.size()) < options_.min_matches) return;
  const double variance = median_chi2(matches) / kMedianChi2;
  const auto step = eliminate_motion(matches, variance);
  if (!step) return;
  const double noise = variance * squared_sigma / static_cast<double>(matches.size());
  estimate_.add(at + step->step, step->information, shift_by_model(std::move(disparities), noise));
}

}  // namespace hybrid_slam
