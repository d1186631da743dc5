#include "apps/scene_renderer/water.h"

#include <algorithm>
#include <cmath>

#include "apps/scene_renderer/noise.h"

namespace hybrid_slam {
namespace {

constexpr float kNearestLamp = 0.06F;  // [m] nearer points are lit no more: lamps are no points

}  // namespace

Color irradiance(const Lamp& lamp, const Water& water, const Eigen::Vector3f& point) {
  const Eigen::Vector3f way = point - lamp.position;
  const float distance = std::max(way.norm(), kNearestLamp);
  const float cosine = way.dot(lamp.axis) / distance;
  if (cosine <= 0) return Color::Zero();
  const float fall = std::pow(cosine, lamp.beam) / (distance * distance);
  return fall * lamp.intensity * exp_of(-distance * water.attenuation);
}

float silt_at(const std::vector<SiltCloud>& clouds, const Eigen::Vector3f& point) {
  float sum = 0;
  for (const SiltCloud& cloud : clouds) {
    const Eigen::Vector3f offset = point - cloud.centre;
    const float q = offset.squaredNorm() / (cloud.radius * cloud.radius);
    if (q > 9) continue;
    const float wisps = gradient_noise(offset / (0.6F * cloud.radius), cloud.seed).value;
    sum += cloud.extinction * std::exp(-q) * std::max(0.0F, 1 + 1.2F * wisps);
  }
  return sum;
}

Color exp_of(const Color& exponent) {
  return {std::exp(exponent[0]), std::exp(exponent[1]), std::exp(exponent[2])};
}

}  // namespace hybrid_slam
