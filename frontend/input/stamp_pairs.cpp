#include "frontend/input/stamp_pairs.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "cameras/files/input_error.h"
#include "frontend/input/stamp_offset.h"

namespace hybrid_slam {

namespace {

std::string milliseconds(double nanoseconds) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.3g", 1e-6 * nanoseconds);
  return text;
}

}  // namespace

std::vector<std::pair<std::size_t, std::size_t>> pair_stamps(const CameraStamps& first,
                                                             const CameraStamps& second,
                                                             const std::string& source,
                                                             double tolerance,
                                                             std::vector<std::string>& warnings) {
  const StampMatch match = match_stamps(first.stamps, second.stamps, tolerance);
  if (match.offset != 0) {
    warnings.push_back(source + ": " + second.camera + "'s times are " +
                       milliseconds(static_cast<double>(match.offset)) + " ms later than " +
                       first.camera + "'s throughout; that offset is taken out");
  }
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (std::size_t f = 0, s = 0; f < first.stamps.size() && s < second.stamps.size();) {
    const std::int64_t difference = match.difference(first.stamps[f], second.stamps[s]);
    if (std::abs(difference) <= match.most) {
      pairs.emplace_back(f++, s++);
    } else {
      ++(difference > 0 ? f : s);
    }
  }
  if (pairs.empty()) {
    throw InputError(source + ": " + first.camera + " and " + second.camera +
                     " have no timestamps in common: the least difference is " +
                     milliseconds(match.least) + " ms, the tolerance " +
                     milliseconds(static_cast<double>(match.most)) + " ms (--pair-tolerance)");
  }
  const std::size_t first_alone = first.stamps.size() - pairs.size();
  const std::size_t second_alone = second.stamps.size() - pairs.size();
  if (first_alone + second_alone > 0) {
    warnings.push_back(source + ": " + std::to_string(first_alone) + " of " + first.camera +
                       "'s and " + std::to_string(second_alone) + " of " + second.camera +
                       "'s timestamps have no partner; those images are left out");
  }
  return pairs;
}

}  // namespace hybrid_slam
