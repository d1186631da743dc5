#include "frontend/calibration/pair_alignment.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include <Eigen/Cholesky>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "cameras/geometry/se3.h"
#include "frontend/matching/pair_check.h"

namespace hybrid_slam {
namespace {

constexpr int kFewest = 50;
constexpr double kAccidentalChi2 = 30.66;  // once in a million: of 3 degrees of freedom
constexpr double kDeviationOfMedian = 1.4826;
constexpr double kInlier = 3;  // standard deviations
constexpr int kRounds = 10;    // of choosing them

using Parameters = Eigen::Vector3d;  // pitch, roll, focal ratio

// d(row in the left image less that in the right one) [px] / d(parameters), at the left place.
Parameters row_derivative(const Calibrated<RectifiedStereo>& camera, const PairMatch& match) {
  const double focal = camera.params[0];
  const double u = (double{match.x} - double{match.disparity} - camera.params[2]) / focal;
  const double v = (double{match.y} - camera.params[3]) / focal;
  return focal * Parameters(1 + v * v, -u, -v);
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

struct RowFit {
  Parameters parameters = Parameters::Zero();
  Parameters cofactors = Parameters::Zero();  // variances of the parameters over a match's [1/px^2]
  double squares = 0;                         // of the residuals
  double modelled = 0;                        // squares of the rows by the parameters
  int matches = 0;
};

// Least squares over the matches within `bound` [px] of the fit before.
RowFit fit_rows(const Calibrated<RectifiedStereo>& camera, const std::vector<PairMatch>& matches,
                const Parameters& before, double bound) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Parameters right = Parameters::Zero();
  double rows = 0;
  RowFit fit;
  for (const PairMatch& match : matches) {
    const Parameters derivative = row_derivative(camera, match);
    if (std::abs(match.rows - derivative.dot(before)) > bound) continue;
    normal += derivative * derivative.transpose();
    right += match.rows * derivative;
    rows += double{match.rows} * match.rows;
    ++fit.matches;
  }
  const Eigen::LDLT<Eigen::Matrix3d> solver(normal);
  fit.parameters = solver.solve(right);
  fit.cofactors = solver.solve(Eigen::Matrix3d::Identity()).diagonal().cwiseMax(0);
  fit.modelled = fit.parameters.dot(normal * fit.parameters);
  fit.squares = std::max(0.0, rows - fit.modelled);
  return fit;
}

}  // namespace

bool is_shown(const PairAlignment& alignment) {
  const double sigma = alignment.row_sigma;
  const double squares = alignment.row_rms * alignment.row_rms;
  return alignment.matches > 0 && alignment.row_rms > std::max(sigma, kHarmlessRows) &&
         alignment.matches * squares > kAccidentalChi2 * sigma * sigma;
}

std::vector<PairMatch> aligned(const Calibrated<RectifiedStereo>& camera,
                               const PairAlignment& alignment, std::span<const PairMatch> matches) {
  const Parameters parameters(alignment.pitch, alignment.roll, alignment.focal_ratio);
  std::vector<PairMatch> result(matches.begin(), matches.end());
  for (PairMatch& match : result) {
    match.rows -= static_cast<float>(row_derivative(camera, match).dot(parameters));
  }
  return result;
}

std::optional<PairAlignment> find_pair_alignment(const Calibrated<RectifiedStereo>& camera,
                                                 std::span<const PairMatch> all) {
  std::vector<PairMatch> matches;
  std::vector<double> rows;
  for (const PairMatch& match : all) {
    if (match.scale > PairCheck::kSmall || match.disparity < 0) continue;
    matches.push_back(match);
    rows.push_back(match.rows);
  }
  if (static_cast<int>(matches.size()) < kFewest) return std::nullopt;
  RowFit fit;
  fit.parameters.x() = median(rows) / camera.params[0];
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> errors;
    for (const PairMatch& match : matches) {
      errors.push_back(std::abs(match.rows - row_derivative(camera, match).dot(fit.parameters)));
    }
    const double bound = kInlier * kDeviationOfMedian * median(std::move(errors));
    const int before = fit.matches;
    fit = fit_rows(camera, matches, fit.parameters, bound);
    if (fit.matches < kFewest || !fit.parameters.allFinite()) return std::nullopt;
    if (fit.matches == before) break;
  }
  const double sigma = std::sqrt(fit.squares / (fit.matches - 3));
  const Parameters sigmas = sigma * fit.cofactors.cwiseSqrt();
  return PairAlignment{fit.parameters[0],
                       fit.parameters[1],
                       fit.parameters[2],
                       fit.matches,
                       std::sqrt(fit.modelled / fit.matches),
                       sigma,
                       sigmas[0],
                       sigmas[1],
                       sigmas[2]};
}

RightAligner::RightAligner(const Calibrated<RectifiedStereo>& camera,
                           const PairAlignment& alignment) {
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  Eigen::Matrix3d pixels;
  pixels << fx, 0, cx, 0, fy, cy, 0, 0, 1;
  const Eigen::Vector3d scale(1 + alignment.focal_ratio, 1 + alignment.focal_ratio, 1);
  const Eigen::Matrix3d turn =
      so3_exp(Eigen::Vector3d(alignment.pitch, 0, alignment.roll)).toRotationMatrix();
  raw_from_aligned_ = pixels * scale.asDiagonal() * turn * pixels.inverse();
}

// Cubic, as StereoRectifier's.
void RightAligner::align(GrayImage& right) const {
  GrayImage result{right.width, right.height, std::vector<std::uint8_t>(right.pixels.size())};
  const cv::Mat source(right.height, right.width, CV_8UC1, right.pixels.data());
  cv::Mat target(right.height, right.width, CV_8UC1, result.pixels.data());
  cv::Mat homography(3, 3, CV_64F);
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) homography.at<double>(r, c) = raw_from_aligned_(r, c);
  }
  cv::warpPerspective(source, target, homography, target.size(),
                      cv::INTER_CUBIC | cv::WARP_INVERSE_MAP, cv::BORDER_REPLICATE);
  right = std::move(result);
}

}  // namespace hybrid_slam
