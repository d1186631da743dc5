#include "frontend/calibration/disparity_offset_fit.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "frontend/pose/damped_gauss_newton.h"

namespace hybrid_slam {
namespace {

constexpr double kFreedom = 5;           // of Student's t
constexpr double kLeastVariance = 1e-6;  // [px^2]: no measurement is perfect
constexpr int kMaxRounds = 10;           // of motion and noise in turn ...
constexpr double kSettledNoise = 0.03;   // ... until variances change by no more
constexpr int kCorrections = 2;          // of a point: the next one is below 1e-3 of its noise
constexpr std::size_t kUnknowns = 7;     // motion and offset
constexpr double kMinDepth = 1e-3;       // [m]
constexpr GaussNewtonStop kStop{20, 1e-6};

using Params = std::array<double, RectifiedStereo::kParamCount>;
using Jacobian = Eigen::Matrix<double, 3, 6, Eigen::RowMajor>;

double squared(double x) { return x * x; }

Eigen::Vector3d with_disparity(const Eigen::Vector3d& m) { return {m[0], m[1], m[0] - m[2]}; }

// A sight in (u, v, disparity), in which noise is independent.
struct Measured {
  Eigen::Vector3d previous, current;
  Eigen::Vector3d previous_variance, current_variance;  // relative ones

  explicit Measured(const StereoSight& sight)
      : previous(with_disparity(sight.previous)),
        current(with_disparity(sight.current)),
        previous_variance(sight.previous_variance, sight.previous_variance, 1),
        current_variance(sight.current_variance, sight.current_variance, 1) {}
};

// A point where both frames together have it.
struct CorrectedSight {
  Eigen::Vector3d residual;  // in the current frame, of the point as the previous one measured it
  Jacobian by_motion;
  Eigen::Matrix3d by_previous;  // by what the previous frame measures
  Eigen::Matrix3d weight;       // inverse covariance of the residual

  double squared_norm() const { return residual.dot(weight * residual); }
};

double t_weight(double squared_norm) { return (kFreedom + 3) / (kFreedom + squared_norm); }

class OffsetFit {
 public:
  OffsetFit(const Params& params, const Rigid3d& start, const SightNoise& noise,
            std::span<const StereoSight> sights)
      : params_(params) {
    result_.motion = start;
    result_.noise = noise;
    const Eigen::Matrix3d rotation = start.rotation().toRotationMatrix();
    for (const StereoSight& sight : sights) {
      const Measured measured(sight);
      CorrectedSight corrected;
      if (!correct(start, rotation, measured, noise, corrected)) continue;
      sights_.push_back(measured);
      corrected_.push_back(corrected);
    }
  }

  std::optional<DisparityOffsetFit> fit() {
    if (sights_.size() < kUnknowns) return std::nullopt;
    for (int round = 0; round < kMaxRounds; ++round) {
      const auto minimum = damped_gauss_newton<6>(
          result_.motion, [&](const Rigid3d& motion) { return linearize(motion, result_.noise); },
          left_perturbed, kStop);
      if (!minimum || !correct(minimum->state, result_.noise)) return std::nullopt;
      result_.motion = minimum->state;
      const SightNoise before = result_.noise;
      result_.noise = estimate_noise(before);
      if ((result_.noise - before).cwiseQuotient(before).cwiseAbs().maxCoeff() < kSettledNoise)
        break;
    }
    return add_offset() ? std::optional(result_) : std::nullopt;
  }

 private:
  double size() const { return static_cast<double>(sights_.size()); }

  // Residual and derivatives of a point that the previous frame should have measured at `seen`.
  // False if no camera sees it there.
  bool linearize_at(const Rigid3d& motion, const Eigen::Matrix3d& rotation, const Measured& sight,
                    const Eigen::Vector3d& seen, CorrectedSight& result) const {
    const auto& [fx, fy, cx, cy, base] = params_;
    if (!(seen[2] > 0)) return false;
    const double z = fx * base / seen[2];
    const Eigen::Vector3d before(z * (seen[0] - cx) / fx, z * (seen[1] - cy) / fy, z);
    Eigen::Matrix3d by_seen = -before / seen[2] * Eigen::RowVector3d::UnitZ();
    by_seen(0, 0) = z / fx;
    by_seen(1, 1) = z / fy;
    const Eigen::Vector3d now = rotation * before + motion.translation();
    if (!(now[2] > kMinDepth)) return false;
    const double inverse_z = 1 / now[2];
    const double x = now[0] * inverse_z, y = now[1] * inverse_z;
    const double disparity = fx * base * inverse_z;
    Eigen::Matrix<double, 3, 3, Eigen::RowMajor> by_point;
    by_point << fx * inverse_z, 0, -fx * x * inverse_z,  //
        0, fy * inverse_z, -fy * y * inverse_z,          //
        0, 0, -disparity * inverse_z;
    result.by_motion = pose_jacobian<3>(by_point, now);
    result.by_previous.noalias() = by_point * (rotation * by_seen);
    result.residual = Eigen::Vector3d(fx * x + cx, fy * y + cy, disparity) - sight.current +
                      result.by_previous * (sight.previous - seen);
    return true;
  }

  bool correct(const Rigid3d& motion, const Eigen::Matrix3d& rotation, const Measured& sight,
               const SightNoise& noise, CorrectedSight& result) const {
    const Eigen::Vector3d of_previous = sight.previous_variance.cwiseProduct(noise);
    Eigen::Vector3d seen = sight.previous;
    for (int i = 0; i < kCorrections; ++i) {
      if (!linearize_at(motion, rotation, sight, seen, result)) return false;
      const Eigen::Matrix3d back = of_previous.asDiagonal() * result.by_previous.transpose();
      Eigen::Matrix3d covariance = result.by_previous * back;
      covariance.diagonal() += sight.current_variance.cwiseProduct(noise);
      result.weight = covariance.inverse();
      seen = sight.previous - back * (result.weight * result.residual);
    }
    return true;
  }

  bool correct(const Rigid3d& motion, const SightNoise& noise) {
    const Eigen::Matrix3d rotation = motion.rotation().toRotationMatrix();
    for (std::size_t i = 0; i < sights_.size(); ++i) {
      if (!correct(motion, rotation, sights_[i], noise, corrected_[i])) return false;
    }
    return true;
  }

  std::optional<NormalEquations<6>> linearize(const Rigid3d& motion, const SightNoise& noise) {
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
  SightNoise estimate_noise(const SightNoise& noise) const {
    SightNoise found = SightNoise::Zero(), expected = SightNoise::Zero();
    double weights = 0;
    for (std::size_t i = 0; i < sights_.size(); ++i) {
      const Measured& sight = sights_[i];
      const CorrectedSight& at = corrected_[i];
      const double weight = t_weight(at.squared_norm());
      const Eigen::Vector3d pull = at.weight * at.residual;
      weights += weight;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d by = at.by_previous.col(k);
        found[k] += weight * (sight.previous_variance[k] * squared(by.dot(pull)) +
                              sight.current_variance[k] * squared(pull[k]));
        expected[k] += sight.previous_variance[k] * by.dot(at.weight * by) +
                       sight.current_variance[k] * at.weight(k, k);
      }
    }
    // Of three residuals each, six have gone into the motion.
    const double freedom = std::max(1 - 2 / size(), 0.1);
    const SightNoise ratio =
        found.cwiseQuotient(expected.cwiseMax(1e-12)) * (size() / weights / freedom);
    return noise.cwiseProduct(ratio).cwiseMax(kLeastVariance);
  }

  // One step of the offset, the motion eliminated. False if the points leave the motion open.
  bool add_offset() {
    Matrix6d motion = Matrix6d::Zero();
    Vector6d mixed = Vector6d::Zero(), gradient = Vector6d::Zero();
    double offset = 0, offset_gradient = 0, psi_slope = 0, squared_psi = 0;
    for (const CorrectedSight& at : corrected_) {
      const double squared_norm = at.squared_norm();
      const double weight = t_weight(squared_norm);
      // A disparity is measured too small by the offset, in both frames.
      const Eigen::Vector3d by_offset = at.by_previous.col(2) - Eigen::Vector3d::UnitZ();
      const Eigen::Matrix<double, 6, 3> weighted = at.by_motion.transpose() * at.weight;
      motion += weighted * at.by_motion;
      mixed += weighted * by_offset;
      gradient += weight * weighted * at.residual;
      const Eigen::Vector3d weighted_offset = at.weight * by_offset;
      offset += weighted_offset.dot(by_offset);
      offset_gradient += weight * weighted_offset.dot(at.residual);
      psi_slope += weight - 2 * weight * weight * squared_norm / (3 * (kFreedom + 3));
      squared_psi += weight * weight * squared_norm / 3;
    }
    if (!is_determined(motion)) return false;
    psi_slope /= size();
    squared_psi /= std::max(size() - static_cast<double>(kUnknowns) / 3, 1.0);
    const Eigen::LLT<Matrix6d> factor(motion);
    const double left = offset - mixed.dot(factor.solve(mixed));
    const double step = -(offset_gradient - mixed.dot(factor.solve(gradient))) / (psi_slope * left);
    if (!(left > 0) || !std::isfinite(step)) return true;
    result_.offset = step;
    result_.information = left * squared(psi_slope) / squared_psi;
    return true;
  }

  const Params& params_;
  DisparityOffsetFit result_;
  std::vector<Measured> sights_;
  std::vector<CorrectedSight> corrected_;  // of the last correct()
};

}  // namespace

std::optional<DisparityOffsetFit> fit_disparity_offset(const Params& params, const Rigid3d& start,
                                                       const SightNoise& noise,
                                                       std::span<const StereoSight> sights) {
  return OffsetFit(params, start, noise, sights).fit();
}

}  // namespace hybrid_slam
