#pragma once

#include <cstdint>
#include <vector>

// How the times of two cameras stand to each other.
namespace hybrid_slam {

// Cameras whose times differ by no more count as triggered together [ns].
inline constexpr double kSynchronous = 5e5;

using Stamps = std::vector<std::int64_t>;  // [ns], strictly ascending

// The time [s] that readers give to an image of this stamp.
inline double seconds_of_stamp(std::int64_t stamp) { return static_cast<double>(stamp) * 1e-9; }

// The usual time between two images [ns]; of less than two a second.
double usual_period(const Stamps& stamps);

// Which images of two cameras are of one time: those whose difference, less `offset`, is at most
// `most`.
struct StampMatch {
  std::int64_t offset = 0;  // by which all of the second camera's are later [ns]
  std::int64_t most = 0;    // [ns]
  double least = 0;         // difference of the two that are nearest to each other [ns]

  // That of the second camera's stamp to the first one's, beyond the offset [ns].
  std::int64_t difference(std::int64_t first, std::int64_t second) const {
    return second - offset - first;
  }
};

// For cameras with clocks. `tolerance` [s] is what the differences may come to; 0: a tenth of the
// frame period, at most 10 ms, in which a vehicle hardly moves. Neither is empty.
StampMatch match_stamps(const Stamps& first, const Stamps& second, double tolerance);

// By how much the image of `second` that is nearest to each of `first` is later [ns]. Neither is
// empty.
std::vector<double> nearest_differences(const Stamps& first, const Stamps& second);

// The offset that nearly all have in common [ns]; 0 if they have none, or it does not count.
std::int64_t common_offset(const std::vector<double>& differences, double period);

}  // namespace hybrid_slam
