#include "frontend/input/stamp_offset.h"

#include <algorithm>
#include <cmath>

#include "frontend/input/median.h"

namespace hybrid_slam {

double usual_period(const Stamps& stamps) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    steps.push_back(static_cast<double>(stamps[i] - stamps[i - 1]));
  }
  return steps.empty() ? 1e9 : median(std::move(steps));
}

std::vector<double> nearest_differences(const Stamps& first, const Stamps& second) {
  std::vector<double> differences;
  std::size_t near = 0;
  for (const std::int64_t stamp : first) {
    while (near + 1 < second.size() &&
           std::abs(second[near + 1] - stamp) <= std::abs(second[near] - stamp)) {
      ++near;
    }
    differences.push_back(static_cast<double>(second[near] - stamp));
  }
  return differences;
}

std::int64_t common_offset(const std::vector<double>& differences, double period) {
  std::vector<double> near;
  for (const double d : differences) {
    if (std::abs(d) < 0.5 * period) near.push_back(d);
  }
  if (near.empty()) return 0;
  const double offset = median(near);
  const auto agreeing = std::count_if(
      near.begin(), near.end(), [&](double d) { return std::abs(d - offset) <= kSynchronous; });
  const bool is_constant = 10 * agreeing >= 9 * static_cast<std::ptrdiff_t>(near.size());
  return std::abs(offset) <= kSynchronous || !is_constant ? 0 : static_cast<std::int64_t>(offset);
}

StampMatch match_stamps(const Stamps& first, const Stamps& second, double tolerance) {
  constexpr double kMost = 1e7;   // [ns]
  constexpr double kShare = 0.1;  // of the period
  const std::vector<double> differences = nearest_differences(first, second);
  const double period = std::min(usual_period(first), usual_period(second));
  const auto closer = [](double a, double b) { return std::abs(a) < std::abs(b); };
  StampMatch match;
  match.most =
      static_cast<std::int64_t>(tolerance > 0 ? tolerance * 1e9 : std::min(kShare * period, kMost));
  match.offset = common_offset(differences, period);
  match.least = *std::min_element(differences.begin(), differences.end(), closer);
  return match;
}

}  // namespace hybrid_slam
