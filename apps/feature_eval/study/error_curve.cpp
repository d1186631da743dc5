#include "apps/feature_eval/study/error_curve.h"

#include <algorithm>

namespace hybrid_slam {

double area_under_curve(std::span<const double> errors_deg) {
  if (errors_deg.empty()) return 0;
  double sum = 0;
  for (const double error : errors_deg) sum += 1 - error / kLargestError;
  return sum / static_cast<double>(errors_deg.size());
}

std::vector<std::pair<double, double>> error_curve(std::span<const double> errors_deg) {
  std::vector<double> sorted(errors_deg.begin(), errors_deg.end());
  std::sort(sorted.begin(), sorted.end());
  std::vector<std::pair<double, double>> corners{{0, 0}};
  const auto count = static_cast<double>(sorted.size());
  for (std::size_t i = 0; i < sorted.size() && sorted[i] < kLargestError; ++i) {
    corners.emplace_back(sorted[i], corners.back().second);
    corners.emplace_back(sorted[i], static_cast<double>(i + 1) / count);
  }
  corners.emplace_back(kLargestError, corners.back().second);
  return corners;
}

}  // namespace hybrid_slam
