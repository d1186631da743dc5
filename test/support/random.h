#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <random>

#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// Random numbers that are the same on every platform.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  std::uint64_t bits() { return engine_(); }
  std::uint64_t below(std::uint64_t count) { return engine_() % count; }

  double uniform() { return uniform(0, 1); }
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }

  int integer(int low, int high) {  // both included
    return low + static_cast<int>(engine_() % static_cast<std::uint64_t>(high - low + 1));
  }

  double gaussian() {  // Box-Muller
    const double radius = std::sqrt(-2 * std::log(uniform(0x1p-53, 1)));
    return radius * std::cos(uniform(0, 2 * std::numbers::pi));
  }

  Eigen::VectorXd vector(int size, double limit) {  // each coordinate in [-limit, limit]
    Eigen::VectorXd v(size);
    for (double& x : v) x = uniform(-limit, limit);
    return v;
  }

  Eigen::Vector3d gaussian3(double sigma) {
    const double x = gaussian();
    const double y = gaussian();
    return sigma * Eigen::Vector3d(x, y, gaussian());
  }

  Eigen::Vector3d direction() {
    for (;;) {
      const Eigen::Vector3d v = vector(3, 1);
      if (v.norm() > 0.1 && v.norm() <= 1) return v.normalized();
    }
  }

  Rigid3d rigid(double translation, double angle) {  // up to these limits
    const double rotation = uniform(0, angle);
    return {Eigen::Quaterniond(Eigen::AngleAxisd(rotation, direction())), vector(3, translation)};
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace hybrid_slam
