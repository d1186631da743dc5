#include "frontend/matching/pair_check.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "frontend/matching/brute_force.h"
#include "frontend/matching/pair_matches.h"

namespace hybrid_slam {

std::vector<PairMatch> match_pair(const FeatureSet& left, const FeatureSet& right) {
  BruteForceOptions options;
  options.ratio = 0.8;  // Lowe 2004
  std::vector<PairMatch> matches;
  for (const DescriptorMatch& match : match_brute_force(left, right, options)) {
    const Keypoint& a = left.keypoints[static_cast<std::size_t>(match.query)];
    const Keypoint& b = right.keypoints[static_cast<std::size_t>(match.train)];
    matches.push_back({a.x, a.y, a.y - b.y, a.x - b.x, std::max(a.scale, b.scale)});
  }
  return matches;
}

PairCheck check_pair(const FeatureSet& left, const FeatureSet& right) {
  PairCheck check;
  std::vector<double> row_errors;
  int near = 0;
  int reversed = 0;
  for (const PairMatch& match : match_pair(left, right)) {
    ++check.matches;
    const double rows = std::abs(match.rows);
    if (match.scale <= PairCheck::kSmall) row_errors.push_back(rows);
    if (rows > PairCheck::kNearRow) continue;
    ++near;
    reversed += match.disparity < -1 ? 1 : 0;
  }
  if (!row_errors.empty()) {
    const auto middle = row_errors.begin() + static_cast<std::ptrdiff_t>(row_errors.size() / 2);
    std::nth_element(row_errors.begin(), middle, row_errors.end());
    check.row_error = *middle;
  }
  if (near > 0) check.reversed = static_cast<double>(reversed) / near;
  return check;
}

}  // namespace hybrid_slam
