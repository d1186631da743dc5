#pragma once

#include <algorithm>
#include <cmath>

namespace hybrid_slam {

// The radius within which a linearisation is believed, as Ceres' Levenberg-Marquardt moves it.
class TrustRegion {
 public:
  // Steps that lower the cost by less than this part of what the linearisation promises are
  // refused.
  static constexpr double kLeastQuality = 1e-3;

  explicit TrustRegion(double radius) : radius_(radius) {}

  double radius() const { return radius_; }

  // quality: the decrease of the cost, in parts of the one promised.
  void accept(double quality) {
    radius_ /= std::max(1.0 / 3, 1 - std::pow(2 * quality - 1, 3));
    radius_ = std::min(radius_, 1e16);
    shrinking_ = 2;
  }

  void reject() {
    radius_ /= shrinking_;
    shrinking_ *= 2;
  }

 private:
  double radius_;
  double shrinking_ = 2;
};

}  // namespace hybrid_slam
