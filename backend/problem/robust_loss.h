#pragma once

#include <cmath>

#include "backend/problem/loss.h"

namespace hybrid_slam {

// A loss of squared residuals s, that sets in at `threshold`.
struct RobustLoss {
  Loss loss = Loss::kNone;
  double threshold = 1;

  // The square root of the weight by which a residual and its derivatives count.
  double root_weight(double s) const {
    if (loss == Loss::kCauchy) return std::sqrt(1 / (1 + s / threshold));
    if (loss == Loss::kHuber && s > threshold) return std::pow(threshold / s, 0.25);
    return 1;
  }

  // What it counts for in the cost: s itself without a loss.
  double cost(double s) const {
    if (loss == Loss::kCauchy) return threshold * std::log1p(s / threshold);
    if (loss == Loss::kHuber && s > threshold) return 2 * std::sqrt(threshold * s) - threshold;
    return s;
  }
};

}  // namespace hybrid_slam
