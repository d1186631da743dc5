#include "frontend/pose/pose_belief.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "frontend/pose/normal_equations.h"

namespace hybrid_slam {
namespace {

constexpr double kMaxLog10FalseAlarms = -6;
constexpr double kMaxSigma = 0.02;  // of the depth

double log10_choose(int n, int k) {
  return (std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0)) /
         std::numbers::ln10;
}

}  // namespace

double log10_false_alarms(const PoseSupport& support, int sample) {
  const int n = support.candidates;
  const int k = support.evidence;
  if (k <= sample || k > n) return std::numeric_limits<double>::infinity();
  return std::log10(n - sample) + log10_choose(n, k) + log10_choose(k, sample) +
         (k - sample) * std::log10(std::clamp(support.chance, 1e-12, 1.0));
}

bool is_no_accident(const PoseSupport& support) {
  return log10_false_alarms(support) <= kMaxLog10FalseAlarms;
}

double translation_sigma(const Matrix6d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> place(
      Eigen::Matrix3d(covariance.topLeftCorner<3, 3>()), Eigen::EigenvaluesOnly);
  return std::sqrt(std::max(0.0, place.eigenvalues()[2]));
}

bool is_certain(const Matrix6d& covariance, double depth) {
  return covariance.allFinite() && translation_sigma(covariance) <= kMaxSigma * depth;
}

bool is_believed(const PoseSupport& support) {
  return is_no_accident(support) && is_certain(support.covariance, support.depth);
}

double chance_in_area(double sigma, double chi2, double area) {
  return std::min(1.0, std::numbers::pi * chi2 * sigma * sigma / area);
}

Matrix6d covariance_of_information(const Matrix6d& information) {
  return is_determined(information) ? Matrix6d(information.inverse()) : PoseSupport().covariance;
}

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace hybrid_slam
