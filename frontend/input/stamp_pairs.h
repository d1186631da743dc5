#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace hybrid_slam {

// When a camera took its images.
struct CameraStamps {
  std::string camera;                // as messages call it
  std::vector<std::int64_t> stamps;  // [ns], strictly ascending, not empty
};

// Pairs what two cameras took at the same time: indices into `first` and `second`, ascending. Two
// images belong together if their times differ by at most `tolerance` [s]; 0: a tenth of the frame
// period, at most 10 ms, in which a vehicle hardly moves. An offset that all have in common is one
// of the clocks, or of the triggers: it is said and taken out. Images without a partner are left
// out and counted in a warning. Throws InputError, beginning with `source`, if no two belong
// together.
std::vector<std::pair<std::size_t, std::size_t>> pair_stamps(const CameraStamps& first,
                                                             const CameraStamps& second,
                                                             const std::string& source,
                                                             double tolerance,
                                                             std::vector<std::string>& warnings);

}  // namespace hybrid_slam
