#include "frontend/odometry/stereo_motion_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/LU>

#include "frontend/pose/damped_gauss_newton.h"
#include "frontend/pose/pose_refinement.h"

namespace hybrid_slam {
namespace {

constexpr int kParts = StereoNoise::SizeAtCompileTime;
constexpr double kFreedom = 5;            // of Student's t
constexpr double kLeastVariance = 1e-6;   // [px^2]: no measurement is perfect
constexpr double kLeastEfficiency = 0.1;  // where residuals fill the threshold evenly
constexpr int kMaxRounds = 10;            // of motion and noise in turn ...
constexpr double kSettled = 0.03;         // ... until variances change by no more
constexpr int kCorrections = 2;           // of a point: the next one is below 1e-3 of its noise
constexpr GaussNewtonStop kStop{20, 1e-6};
// From where the estimate of the noise begins: a fifth of a pixel.
const StereoNoise kFirstNoise(0.02, 0.04, 0.08, 0.01);

using Params = std::array<double, RectifiedStereo::kParamCount>;
using Jacobian = Eigen::Matrix<double, 3, 6, Eigen::RowMajor>;

// (u_left, v, u_right) -> (their mean, v, disparity), in which noise is independent.
Eigen::Vector3d terms(const Eigen::Vector3d& m) { return {0.5 * (m[0] + m[2]), m[1], m[0] - m[2]}; }

double squared(double x) { return x * x; }

// A sight in those terms.
struct Measured {
  Eigen::Vector3d previous, current;
  double previous_variance, current_variance;
  Eigen::Vector3d by_lens;  // its variances, per unit of the lens'

  Measured(const Params& params, const StereoSight& sight)
      : previous(terms(sight.previous)),
        current(terms(sight.current)),
        previous_variance(sight.previous_variance),
        current_variance(sight.current_variance) {
    const double cx = std::max(std::abs(params[2]), 1.0);
    const double squared_distance =
        (squared(current[0] - params[2]) + squared(current[1] - params[3])) / (cx * cx);
    const double sixth_power = squared_distance * squared_distance * squared_distance;
    by_lens << sixth_power, sixth_power, 0.25 * sixth_power;
  }
};

// A point where both frames together have it.
struct CorrectedSight {
  Eigen::Vector3d residual;  // in the current frame, of the point as the previous one measured it
  Jacobian by_motion;
  Eigen::Matrix3d by_previous;  // by what the previous frame measures
  Eigen::Matrix3d covariance;   // of the residual
  Eigen::Matrix3d weight;       // its inverse

  double squared_norm() const { return residual.dot(weight * residual); }
};

double t_weight(double squared_norm) { return (kFreedom + 3) / (kFreedom + squared_norm); }

class MotionFit {
 public:
  MotionFit(const Params& params, std::span<const StereoSight> sights, double threshold)
      : params_(params), threshold_(threshold) {
    for (const StereoSight& sight : sights) sights_.emplace_back(params, sight);
    corrected_.resize(sights.size());
    efficiency_.assign(sights.size(), 1.0);
  }

  std::optional<FittedStereoMotion> fit(const Rigid3d& start) {
    FittedStereoMotion result;
    result.motion = start;
    result.noise = kFirstNoise;
    for (int round = 0; round < kMaxRounds; ++round) {
      const auto minimum = damped_gauss_newton<6>(
          result.motion, [&](const Rigid3d& motion) { return linearize(motion, result.noise); },
          left_perturbed, kStop);
      if (!minimum) return std::nullopt;
      result.motion = minimum->state;
      const StereoNoise before = result.noise;
      if (!correct(result.motion, before)) return std::nullopt;
      result.noise = estimate_noise(before);
      if ((result.noise - before).cwiseQuotient(before).cwiseAbs().maxCoeff() < kSettled) break;
    }
    return add_uncertainty(result) ? std::optional(result) : std::nullopt;
  }

 private:
  double size() const { return static_cast<double>(sights_.size()); }

  // Residual and derivatives of a point that the previous frame should have measured at `seen`.
  // False if no camera sees it there.
  bool linearize_at(const Rigid3d& motion, const Eigen::Matrix3d& rotation, const Measured& sight,
                    const Eigen::Vector3d& seen, CorrectedSight& result) const {
    const auto& [fx, fy, cx, cy, base] = params_;
    const double d = seen[2];
    if (!(d > 0)) return false;
    const double z = fx * base / d;
    const Eigen::Vector3d before(z * (seen[0] + 0.5 * d - cx) / fx, z * (seen[1] - cy) / fy, z);
    Eigen::Matrix3d by_seen;
    by_seen << z / fx, 0, 0.5 * z / fx - before[0] / d, 0, z / fy, -before[1] / d, 0, 0, -z / d;
    const Eigen::Vector3d now = rotation * before + motion.translation();
    if (!(now[2] > kMinDepth)) return false;
    const double inverse_z = 1 / now[2];
    const double x = now[0] * inverse_z, y = now[1] * inverse_z;
    const double disparity = fx * base * inverse_z;
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_point;
    by_point << fx * inverse_z, 0, (0.5 * disparity - fx * x) * inverse_z,  //
        0, fy * inverse_z, -fy * y * inverse_z,                             //
        0, 0, -disparity * inverse_z;
    result.by_motion = pose_jacobian<3>(by_point, now);
    result.by_previous.noalias() = by_point * (rotation * by_seen);
    result.residual = Eigen::Vector3d(fx * x + cx - 0.5 * disparity, fy * y + cy, disparity) -
                      sight.current + result.by_previous * (sight.previous - seen);
    return true;
  }

  bool correct(const Rigid3d& motion, const Eigen::Matrix3d& rotation, const Measured& sight,
               const StereoNoise& noise, CorrectedSight& result) const {
    const Eigen::Vector3d of_previous = sight.previous_variance * noise.head<3>();
    Eigen::Vector3d seen = sight.previous;
    for (int i = 0; i < kCorrections; ++i) {
      if (!linearize_at(motion, rotation, sight, seen, result)) return false;
      const Eigen::Matrix3d back = of_previous.asDiagonal() * result.by_previous.transpose();
      result.covariance.noalias() = result.by_previous * back;
      result.covariance.diagonal() +=
          sight.current_variance * noise.head<3>() + noise[3] * sight.by_lens;
      result.weight = result.covariance.inverse();
      seen = sight.previous - back * (result.weight * result.residual);
    }
    return true;
  }

  bool correct(const Rigid3d& motion, const StereoNoise& noise) {
    const Eigen::Matrix3d rotation = motion.rotation().toRotationMatrix();
    for (std::size_t i = 0; i < sights_.size(); ++i) {
      if (!correct(motion, rotation, sights_[i], noise, corrected_[i])) return false;
    }
    return true;
  }

  std::optional<NormalEquations<6>> linearize(const Rigid3d& motion, const StereoNoise& noise) {
    if (!correct(motion, noise)) return std::nullopt;
    NormalEquations<6> equations;
    for (const CorrectedSight& sight : corrected_) {
      const double squared_norm = sight.squared_norm();
      const Jacobian weighted = t_weight(squared_norm) * sight.weight * sight.by_motion;
      equations.gradient.noalias() += weighted.transpose() * sight.residual;
      equations.information.noalias() += weighted.transpose() * sight.by_motion;
      equations.cost += (kFreedom + 3) * std::log1p(squared_norm / kFreedom);
    }
    return equations;
  }

  // Each variance by the share that it has in what the residuals are: one round of the estimate,
  // from the residuals that correct() left. Normalised by the sum of the weights, which is the
  // number of points where it ends, and is there sooner (Meng and van Dyk, JRSS B 1997).
  StereoNoise estimate_noise(const StereoNoise& noise) {
    StereoNoise found = StereoNoise::Zero(), expected = StereoNoise::Zero();
    double weights = 0;
    for (std::size_t i = 0; i < sights_.size(); ++i) {
      const Measured& sight = sights_[i];
      const CorrectedSight& at = corrected_[i];
      const double weight = t_weight(at.squared_norm());
      const Eigen::Vector3d pull = at.weight * at.residual;
      weights += weight;
      efficiency_[i] = efficiency(at.covariance);
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d b = at.by_previous.col(k);
        found[k] += weight * (sight.previous_variance * squared(b.dot(pull)) +
                              sight.current_variance * squared(pull[k]));
        expected[k] += efficiency_[i] * (sight.previous_variance * b.dot(at.weight * b) +
                                         sight.current_variance * at.weight(k, k));
      }
      found[3] += weight * sight.by_lens.dot(pull.cwiseAbs2());
      expected[3] += efficiency_[i] * sight.by_lens.dot(at.weight.diagonal());
    }
    // Of three residuals each, six have gone into the motion.
    const double freedom = std::max(1 - 2 / size(), 0.1);
    const StereoNoise ratio =
        found.cwiseQuotient(expected.cwiseMax(1e-12)) * (size() / weights / freedom);
    return noise.cwiseProduct(ratio).cwiseMax(kLeastVariance);
  }

  // What the threshold leaves of a point, by the mean variance of its four residuals.
  double efficiency(const Eigen::Matrix3d& covariance) const {
    // u_left^2 + u_right^2 = 2 mean^2 + disparity^2 / 2.
    const double mean = (2 * covariance(0, 0) + 2 * covariance(1, 1) + 0.5 * covariance(2, 2)) / 3;
    return std::max(kLeastEfficiency, inlier_efficiency(3, threshold_ * threshold_ / mean));
  }

  // False if the points leave the motion open.
  bool add_uncertainty(FittedStereoMotion& result) const {
    const Eigen::Vector3d unit(-0.5, 0, 1);  // what u_right smaller by one does to a sight
    Matrix6d slope = Matrix6d::Zero(), spread = Matrix6d::Zero();
    Vector6d mixed = Vector6d::Zero();
    double psi_slope = 0, squared_psi = 0;
    for (std::size_t i = 0; i < sights_.size(); ++i) {
      const CorrectedSight& at = corrected_[i];
      const double squared_norm = at.squared_norm();
      const double weight = t_weight(squared_norm);
      const Eigen::Vector3d by_offset = at.by_previous * unit - unit;
      const Eigen::Matrix<double, 6, 3> weighted = at.by_motion.transpose() * at.weight;
      const Matrix6d information = weighted * at.by_motion;
      slope += efficiency_[i] * information;
      spread += information;
      mixed += efficiency_[i] * weighted * by_offset;
      psi_slope += weight - 2 * weight * weight * squared_norm / (3 * (kFreedom + 3));
      squared_psi += weight * weight * squared_norm / 3;
    }
    if (!is_determined(slope)) return false;
    psi_slope /= size();
    squared_psi /= std::max(size() - 2, 1.0);
    const Matrix6d inverse = slope.inverse();
    const Matrix6d covariance = squared_psi / squared(psi_slope) * inverse * spread * inverse;
    result.covariance = 0.5 * (covariance + covariance.transpose());
    result.by_offset = -inverse * mixed;
    return is_determined(result.covariance);
  }

  const Params& params_;
  double threshold_;
  std::vector<Measured> sights_;
  std::vector<CorrectedSight> corrected_;  // of the last correct()
  std::vector<double> efficiency_;         // of the last estimate_noise()
};

}  // namespace

std::optional<FittedStereoMotion> fit_stereo_motion(const Params& params, const Rigid3d& start,
                                                    std::span<const StereoSight> sights,
                                                    double threshold) {
  return MotionFit(params, sights, threshold).fit(start);
}

}  // namespace hybrid_slam
