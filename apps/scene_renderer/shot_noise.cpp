#include "apps/scene_renderer/shot_noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "apps/scene_renderer/noise.h"

namespace hybrid_slam {
namespace {

constexpr float kInvertedUpTo = 50;

}  // namespace

float gaussian(std::uint32_t bits) {
  const float radius = std::sqrt(-2 * std::log(1 - unit_interval(mixed_bits(1, 0, 53, bits))));
  const float turn = unit_interval(mixed_bits(2, 0, 53, bits));
  return radius * std::cos(2 * std::numbers::pi_v<float> * turn);
}

float poisson(float mean, std::uint32_t bits) {
  if (mean > kInvertedUpTo) {
    return std::max(0.0F, std::round(mean + std::sqrt(mean) * gaussian(bits)));
  }
  const double u = unit_interval(mixed_bits(3, 0, 53, bits));
  double share = std::exp(-static_cast<double>(mean)), below = share;
  float count = 0;
  while (u >= below && share > 0) {
    ++count;
    share *= mean / count;
    below += share;
  }
  return count;
}

}  // namespace hybrid_slam
