#include "apps/scene_renderer/noise.h"

#include <array>
#include <cmath>

#include "apps/scene_renderer/octave_kernel.h"

namespace hybrid_slam {
namespace {

// A lattice gradient from hashed bits: each component from -1 to 1.
Eigen::Vector3f gradient_of(std::uint32_t bits) {
  constexpr float kScale = 2.0F / 1023;
  const auto component = [&](int shift) {
    return static_cast<float>(static_cast<int>((bits >> shift) & 1023U)) * kScale - 1;
  };
  return {component(0), component(10), component(20)};
}

std::int32_t floor_of(float x) {
  const auto toward_zero = static_cast<std::int32_t>(x);
  return toward_zero - (x < static_cast<float>(toward_zero) ? 1 : 0);
}

float mix(float a, float b, float t) { return a + t * (b - a); }

}  // namespace

NoiseSample gradient_noise(const Eigen::Vector3f& p, std::uint32_t seed) {
  std::array<std::int32_t, 3> cell{};
  Eigen::Vector3f f, fade, slope;
  for (int i = 0; i < 3; ++i) {
    cell[static_cast<std::size_t>(i)] = floor_of(p[i]);
    const float t = p[i] - static_cast<float>(cell[static_cast<std::size_t>(i)]);
    f[i] = t;
    fade[i] = t * t * t * (t * (t * 6 - 15) + 10);
    slope[i] = 30 * t * t * (t * (t - 2) + 1);
  }
  // Per corner (x is the lowest bit): the gradient there and the height that it gives at p.
  std::array<float, 8> gx{}, gy{}, gz{}, h{};
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const auto ix = static_cast<int>(corner & 1), iy = static_cast<int>((corner >> 1) & 1),
               iz = static_cast<int>(corner >> 2);
    const Eigen::Vector3f gradient =
        gradient_of(mixed_bits(cell[0] + ix, cell[1] + iy, cell[2] + iz, seed));
    gx[corner] = gradient.x();
    gy[corner] = gradient.y();
    gz[corner] = gradient.z();
    h[corner] = gradient.x() * (f.x() - static_cast<float>(ix)) +
                gradient.y() * (f.y() - static_cast<float>(iy)) +
                gradient.z() * (f.z() - static_cast<float>(iz));
  }
  const auto plane = [](float a, float b, float c, float d, float u, float v) {
    return mix(mix(a, b, u), mix(c, d, u), v);
  };
  const auto space = [&](const std::array<float, 8>& v) {
    return mix(plane(v[0], v[1], v[2], v[3], fade.x(), fade.y()),
               plane(v[4], v[5], v[6], v[7], fade.x(), fade.y()), fade.z());
  };
  const Eigen::Vector3f across(
      plane(h[1] - h[0], h[3] - h[2], h[5] - h[4], h[7] - h[6], fade.y(), fade.z()),
      plane(h[2] - h[0], h[3] - h[1], h[6] - h[4], h[7] - h[5], fade.x(), fade.z()),
      plane(h[4] - h[0], h[5] - h[1], h[6] - h[2], h[7] - h[3], fade.x(), fade.y()));
  return {space(h), Eigen::Vector3f(space(gx), space(gy), space(gz)) + slope.cwiseProduct(across)};
}

NoiseSample octave_noise(const Eigen::Vector3f& p, const Octaves& octaves, float footprint,
                         std::uint32_t seed) {
  OctavePoints points;
  float amplitude = 1;
  // Lattices of octaves must not share their zeros at the origin: each has its own offset.
  Eigen::Vector3f shift(0.31F, 0.57F, 0.73F);
  for (float wavelength = octaves.longest;
       wavelength >= octaves.shortest && points.count < kMaxOctaves; wavelength *= 0.5F) {
    const float weight = amplitude * smooth_step(2 * footprint, 4 * footprint, wavelength);
    if (weight <= 0) break;
    const std::size_t i = points.count++;
    const Eigen::Vector3f place = p / wavelength + shift;
    points.x[i] = place.x();
    points.y[i] = place.y();
    points.z[i] = place.z();
    points.weight[i] = weight;
    points.seed[i] = seed++;
    amplitude *= octaves.gain;
    shift += Eigen::Vector3f(0.37F, 0.41F, 0.19F);
  }
  if (points.count == 0) return {};
  std::array<float, 4> sum{};
  sum_octaves(points, sum.data());
  return {sum[0], {sum[1], sum[2], sum[3]}};
}

Ball ball_near(const Eigen::Vector3f& p, std::uint32_t seed) {
  const Eigen::Vector3f floor = p.array().floor();
  const Eigen::Vector3i cell = floor.cast<int>();
  const std::uint32_t bits = mixed_bits(cell.x(), cell.y(), cell.z(), seed);
  Ball ball;
  ball.bits = mixed_bits(cell.y(), cell.z(), cell.x(), seed + 1);
  ball.radius = 0.1F + 0.24F * unit_interval(ball.bits << 7);
  const float margin = 1.25F * ball.radius + kBallRim;
  const float room = 1 - 2 * margin;
  constexpr float kScale = 1.0F / 1023;
  const Eigen::Vector3f random(static_cast<float>(bits & 1023U) * kScale,
                               static_cast<float>((bits >> 10) & 1023U) * kScale,
                               static_cast<float>((bits >> 20) & 1023U) * kScale);
  ball.offset = p - floor - Eigen::Vector3f::Constant(margin) - room * random;
  return ball;
}

}  // namespace hybrid_slam
