#pragma once

#include <span>
#include <utility>
#include <vector>

namespace hybrid_slam {

// An error that stands for none: of a pair of images whose motion was not found [deg].
inline constexpr double kLargestError = 180;

// The area under the curve "share of the pairs whose error is at most x", for x from 0 to 180
// degrees, as a share of all: 1 if no pair has an error, 0 if all have 180 degrees. The curve goes
// up in steps, at each error by one pair, so that the area is exact: the mean of 1 - error / 180.
// Errors in [0, 180] degrees; no pairs: 0.
double area_under_curve(std::span<const double> errors_deg);

// The corners of that curve from (0, ...) to (180, ...): error [deg] and share.
std::vector<std::pair<double, double>> error_curve(std::span<const double> errors_deg);

}  // namespace hybrid_slam
