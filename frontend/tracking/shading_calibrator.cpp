#include "frontend/tracking/shading_calibrator.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>

#include <Eigen/Cholesky>

namespace hybrid_slam {
namespace {

constexpr double kReliefExponent = 0.75;  // H
constexpr double kReferenceSize = 1e-3;   // [rad]
constexpr double kMedianSquare = 0.4549;  // of a standard normal variable
constexpr double kOutlierSquare = 9;      // 3 standard deviations
constexpr int kRounds = 3;                // of choosing inliers
constexpr double kOffsetSigma = 0.2;      // [px] of an offset of the disparities
// A landmark's disparity and patch in its first keyframe are part of all its tracks.
constexpr double kShareOfTrack = 0.2;

// lag = scale error + offset / disparity + relative shading depth.
using Line = Eigen::Vector3d;

Line line_of(const ShadedTrack& track) {
  return {1, 1 / track.disparity, ShadingCalibrator::relative_depth(1, track.size)};
}

double weight_of(const ShadedTrack& track) {
  const double variance =
      track.sigma * track.sigma *
      (1 / (track.disparity * track.disparity) + 1 / (track.parallax * track.parallax));
  return 1 / variance;
}

bool usable(const ShadedTrack& track) {
  return track.disparity > 0 && track.parallax > 0 && track.sigma > 0 && track.size > 0 &&
         std::isfinite(track.lag);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<long>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

struct Fit {
  Line parameters = Line::Zero();
  double variance = 1;     // of a whitened residual
  double information = 0;  // of the last parameter, the others eliminated
};

// Weighted squares of the residuals.
std::vector<double> squares_of(const std::vector<ShadedTrack>& tracks, const Line& parameters) {
  std::vector<double> squares;
  squares.reserve(tracks.size());
  for (const ShadedTrack& track : tracks) {
    const double residual = track.lag - line_of(track).dot(parameters);
    squares.push_back(weight_of(track) * residual * residual);
  }
  return squares;
}

// Least squares over the tracks that agree with the fit before.
std::optional<Fit> fit_line(const std::vector<ShadedTrack>& tracks, const Fit& before) {
  const std::vector<double> squares = squares_of(tracks, before.parameters);
  Fit fit;
  fit.variance = median(squares) / kMedianSquare;
  if (!(fit.variance > 0)) return std::nullopt;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Line right = Line::Zero();
  normal(1, 1) = 1 / (kOffsetSigma * kOffsetSigma);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    if (squares[i] > kOutlierSquare * fit.variance) continue;
    const double weight = weight_of(tracks[i]) / fit.variance;
    const Line line = line_of(tracks[i]);
    normal += weight * line * line.transpose();
    right += weight * tracks[i].lag * line;
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
  if (solver.info() != Eigen::Success || !solver.isPositive()) return std::nullopt;
  fit.parameters = solver.solve(right);
  fit.information = 1 / solver.solve(Line::UnitZ()).z();
  if (!fit.parameters.allFinite() || !(fit.information > 0) || !std::isfinite(fit.information)) {
    return std::nullopt;
  }
  return fit;
}

}  // namespace

std::string ShadingCalibratorOptions::validate() const {
  if (!(prior_sigma > 0)) return "shading: prior_sigma must be positive";
  if (!(min_significance >= 0)) return "shading: min_significance must not be negative";
  if (min_tracks < 10) return "shading: min_tracks must be at least 10";
  return {};
}

ShadedTrack make_shaded_track(const Calibrated<RectifiedStereo>& camera,
                              const Rigid3d& now_from_first, const Keypoint& first, double u_right,
                              const Keypoint& now, double depth) {
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  const auto ray_of = [&, fx = fx, fy = fy, cx = cx, cy = cy](const Keypoint& keypoint) {
    return Eigen::Vector3d((double{keypoint.x} - cx) / fx, (double{keypoint.y} - cy) / fy, 1);
  };
  // ray x (turned + translation / depth) = 0, in the two rows that matter
  const Eigen::Vector3d ray = ray_of(now);
  const Eigen::Vector3d turned = now_from_first.rotation() * ray_of(first);
  const Eigen::Vector3d& translation = now_from_first.translation();
  const Eigen::Vector2d rest = (turned - ray * turned.z()).head<2>();
  const Eigen::Vector2d slope = (translation - ray * translation.z()).head<2>();
  const double by_parallax = -rest.dot(slope) / slope.squaredNorm();
  const double by_disparity = (double{first.x} - u_right) / (fx * baseline);
  return {.disparity = fx * baseline / depth,
          .parallax = fx * slope.norm() / depth,
          .lag = (by_disparity - by_parallax) * depth,
          .size = double{first.scale} / fx,
          .sigma = double{now.sigma}};
}

ShadingCalibrator::ShadingCalibrator(const ShadingCalibratorOptions& options,
                                     const std::optional<FoundParameter>& start)
    : options_(options),
      estimate_(options.prior_sigma, kShareOfTrack, options.min_significance,
                options.enabled ? start : std::nullopt) {
  const std::string error = options.validate();
  if (!error.empty()) throw std::invalid_argument(error);
}

void ShadingCalibrator::add(const std::vector<ShadedTrack>& tracks, double corrected) {
  if (!options_.enabled) return;
  std::vector<ShadedTrack> used;
  std::copy_if(tracks.begin(), tracks.end(), std::back_inserter(used), usable);
  if (static_cast<int>(used.size()) < options_.min_tracks) return;
  Fit fit;
  for (int round = 0; round < kRounds; ++round) {
    const auto better = fit_line(used, fit);
    if (!better) return;
    fit = *better;
  }
  estimate_.add(corrected + fit.parameters.z(), fit.information);
}

ShadingDoubt ShadingCalibrator::doubt(double size) const {
  if (!options_.enabled) return {};
  return {.of_vehicle = relative_depth(sigma(), size),
          .of_arm = relative_depth(std::hypot(depth_per_size(), sigma()), size)};
}

double ShadingCalibrator::relative_depth(double depth_per_size, double size) {
  return depth_per_size * kReferenceSize * std::pow(size / kReferenceSize, kReliefExponent);
}

}  // namespace hybrid_slam
