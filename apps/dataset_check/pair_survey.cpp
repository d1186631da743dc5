#include "apps/dataset_check/pair_survey.h"

#include <algorithm>
#include <cmath>

#include "frontend/input/median.h"
#include "frontend/matching/pair_check.h"

namespace hybrid_slam {
namespace {

template <typename Belongs>
RowAgreement agreement(const std::vector<PairMatch>& matches, Belongs belongs) {
  std::vector<double> offsets, errors;
  for (const PairMatch& match : matches) {
    if (match.scale > PairCheck::kSmall || !belongs(match)) continue;
    offsets.push_back(match.rows);
    errors.push_back(std::abs(match.rows));
  }
  RowAgreement rows;
  rows.matches = static_cast<int>(offsets.size());
  rows.error = median(std::move(errors));
  rows.offset = median(std::move(offsets));
  return rows;
}

int cell(float at, int size, int cells) {
  return std::clamp(static_cast<int>(at * static_cast<float>(cells) / static_cast<float>(size)), 0,
                    cells - 1);
}

}  // namespace

void PairSurvey::add(const std::vector<PairMatch>& matches) {
  all_.insert(all_.end(), matches.begin(), matches.end());
}

RowAgreement PairSurvey::rows() const {
  return agreement(all_, [](const PairMatch&) { return true; });
}

RowAgreement PairSurvey::rows_in(int column, int row) const {
  return agreement(all_, [&](const PairMatch& match) {
    return cell(match.x, width_, kGrid) == column && cell(match.y, height_, kGrid) == row;
  });
}

double PairSurvey::reversed() const {
  int near = 0, reversed = 0;
  for (const PairMatch& match : all_) {
    if (std::abs(match.rows) > PairCheck::kNearRow) continue;
    ++near;
    reversed += match.disparity < -1 ? 1 : 0;
  }
  return near > 0 ? static_cast<double>(reversed) / near : 0;
}

double PairSurvey::disparity(double percent) const {
  constexpr double kAgree = 3;  // [px] of the rows, several deviations of coarse features
  const double offset = rows().offset;
  std::vector<double> disparities;
  for (const PairMatch& match : all_) {
    if (std::abs(match.rows - offset) <= kAgree) disparities.push_back(match.disparity);
  }
  if (disparities.empty()) return 0;
  const auto rank = static_cast<std::ptrdiff_t>(
      std::ceil(0.01 * percent * static_cast<double>(disparities.size())));
  const auto at =
      disparities.begin() + std::clamp<std::ptrdiff_t>(rank - 1, 0, std::ssize(disparities) - 1);
  std::nth_element(disparities.begin(), at, disparities.end());
  return *at;
}

}  // namespace hybrid_slam
