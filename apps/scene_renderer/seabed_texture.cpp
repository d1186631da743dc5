#include "apps/scene_renderer/seabed_texture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "apps/scene_renderer/noise.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3f;

const Color kSand(0.40F, 0.36F, 0.28F);
const Color kSilt(0.17F, 0.16F, 0.14F);
const Color kAlgae(0.15F, 0.19F, 0.08F);
const Color kPaleRock(0.34F, 0.32F, 0.28F);
const Color kDarkRock(0.10F, 0.095F, 0.09F);
const Color kCoralline(0.42F, 0.21F, 0.24F);
const Color kShell(0.72F, 0.69F, 0.62F);

Color mix(const Color& a, const Color& b, float t) { return a + t * (b - a); }

// Tilts a normal by the gradient of a drawn relief of slope `strength`.
Vector3f tilted(const Vector3f& normal, const Vector3f& gradient, float strength) {
  const Vector3f along = gradient - gradient.dot(normal) * normal;
  return (normal - strength * along).normalized();
}

struct PebbleScale {
  float cell;           // [m]
  std::uint32_t share;  // of 256 cells hold a pebble
  float brightness;     // of the lighter ones
};

constexpr PebbleScale kPebbles[] = {{0.11F, 90, 0.8F},
                                    {0.052F, 130, 1},
                                    {0.023F, 170, 1.1F},
                                    {0.011F, 190, 1.2F},
                                    {0.005F, 200, 1.2F}};

// Turns each lattice another way, so that no rows of cells show.
Eigen::Matrix3f lattice_turn(std::uint32_t seed) {
  static const auto turns = [] {
    std::array<Eigen::Matrix3f, 16> matrices;
    for (std::size_t i = 0; i < matrices.size(); ++i) {
      const auto angle = static_cast<float>(i);
      const Vector3f axis(std::sin(1.7F * angle), std::cos(2.9F * angle), 0.8F);
      matrices[i] = Eigen::AngleAxisf(1 + 1.3F * angle, axis.normalized()).toRotationMatrix();
    }
    return matrices;
  }();
  return turns[seed % turns.size()];
}

// Stones and shells: where a ball of the lattice cuts the surface, its colour and roundness show.
void add_pebbles(const SurfacePoint& point, std::uint32_t seed, std::uint32_t thinning,
                 SurfaceLook& look) {
  for (const PebbleScale& scale : kPebbles) {
    const float visible = smooth_step(1.5F * point.footprint, 4 * point.footprint, scale.cell);
    if (visible <= 0) break;
    ++seed;
    const Ball ball = ball_near(lattice_turn(seed) * point.position / scale.cell, seed);
    if ((ball.bits & 255U) * thinning >= scale.share) continue;
    const float ragged = 0.35F * gradient_noise(ball.offset / 0.2F, ball.bits).value;
    const float depth = ball.radius * (1 + std::clamp(ragged, -0.25F, 0.25F)) - ball.offset.norm();
    const float edge = std::max(point.footprint / scale.cell, 0.03F);
    const float shadow = visible * smooth_step(-kBallRim, 0, depth);
    look.albedo *= 1 - 0.45F * shadow;  // no light reaches the rim
    const float inside = visible * smooth_step(-edge, edge, depth);
    if (inside <= 0) continue;
    const float tone = unit_interval(ball.bits);
    const Color stone = tone > 0.93F ? Color(kShell * scale.brightness)
                                     : Color(mix(kDarkRock, kSand, 1.2F * tone) * scale.brightness);
    const float grain = 1 + 0.5F * gradient_noise(ball.offset / 0.11F, ball.bits + 1).value;
    look.albedo = mix(look.albedo, stone * grain, inside);
    const Vector3f bulge = ball.offset / std::max(ball.radius, 1e-6F);
    look.normal =
        (look.normal + 0.7F * inside * (bulge - bulge.dot(look.normal) * look.normal)).normalized();
  }
}

// Thin dark lines where noise crosses zero.
void add_cracks(const SurfacePoint& point, float wavelength, float strength, std::uint32_t seed,
                SurfaceLook& look) {
  const float visible =
      strength * smooth_step(6 * point.footprint, 20 * point.footprint, wavelength);
  if (visible <= 0) return;
  const float presence = gradient_noise(point.position / (1.3F * wavelength), seed + 9).value;
  const float depth = visible * smooth_step(0, 0.35F, presence);  // they open and close
  if (depth <= 0) return;
  const NoiseSample noise = gradient_noise(point.position / wavelength, seed);
  const float slope = std::max(noise.gradient.norm(), 0.3F);
  const float distance = std::abs(noise.value) / slope;  // to the line, in wavelengths
  const float width = std::max(0.018F, 0.8F * point.footprint / wavelength);
  const float line = depth * (1 - smooth_step(0.3F * width, width, distance));
  look.albedo *= 1 - 0.7F * line;
}

SurfaceLook ground_look(const SurfacePoint& point) {
  const Vector3f& p = point.position;
  const NoiseSample detail = octave_noise(p, {0.55F, 0.0015F, 0.93F}, point.footprint, point.seed);
  const NoiseSample tone = octave_noise(p, {0.9F, 0.09F, 0.7F}, point.footprint, point.seed + 40);
  const float growth = gradient_noise(p / 0.37F, point.seed + 60).value + 0.35F * detail.value;
  SurfaceLook look;
  look.albedo = mix(kSand, kSilt, smooth_step(-0.45F, 0.5F, tone.value));
  look.albedo = mix(look.albedo, kAlgae, 0.8F * smooth_step(0.2F, 0.55F, growth));
  look.albedo *= std::exp(1.15F * detail.value);
  look.normal = tilted(point.normal, detail.gradient, 0.27F);
  add_pebbles(point, point.seed + 80, 1, look);
  return look;
}

SurfaceLook rock_look(const SurfacePoint& point) {
  const Vector3f& p = point.position;
  const NoiseSample detail = octave_noise(p, {0.21F, 0.0015F, 0.97F}, point.footprint, point.seed);
  const NoiseSample tone = octave_noise(p, {0.3F, 0.07F, 0.8F}, point.footprint, point.seed + 40);
  const float growth = gradient_noise(p / 0.13F, point.seed + 60).value + 0.4F * detail.value;
  const float kind = unit_interval(mixed_bits(1, 2, 3, point.seed));
  SurfaceLook look;
  look.albedo = mix(kDarkRock, kPaleRock, kind) * (1 + 0.9F * tone.value);
  look.albedo = mix(look.albedo, kSand, 0.7F * smooth_step(0.82F, 0.97F, point.normal.z()));
  look.albedo = mix(look.albedo, kind > 0.6F ? kCoralline : kAlgae,
                    0.75F * smooth_step(0.15F, 0.45F, growth));
  look.albedo *= std::exp(1.2F * detail.value);
  look.normal = tilted(point.normal, detail.gradient, 0.36F);
  add_cracks(point, 0.19F, 1, point.seed + 61, look);
  add_cracks(point, 0.07F, 0.8F, point.seed + 62, look);
  add_cracks(point, 0.026F, 0.6F, point.seed + 63, look);
  add_pebbles(point, point.seed + 80, 3, look);  // barnacles and the like
  return look;
}

// Fine grains, faint patches, and here and there a shell: little to hold on to.
SurfaceLook sand_look(const SurfacePoint& point) {
  const Vector3f& p = point.position;
  const NoiseSample detail = octave_noise(p, {0.03F, 0.0015F, 0.95F}, point.footprint, point.seed);
  const NoiseSample tone = octave_noise(p, {0.9F, 0.09F, 0.6F}, point.footprint, point.seed + 40);
  SurfaceLook look;
  look.albedo = kSand * std::exp(0.3F * detail.value + 0.15F * tone.value);
  look.normal = tilted(point.normal, detail.gradient, 0.05F);
  add_pebbles(point, point.seed + 80, 24, look);
  return look;
}

// Dark yellow, black and grey paint, patch by patch (a pale arm so near to the lamps would make the
// camera underexpose the ground): the patches go with the arm, as noise would not.
SurfaceLook arm_look(const SurfacePoint& point) {
  const float kind = unit_interval(point.seed);
  const Color paint = kind < 0.45F  ? Color(0.22F, 0.15F, 0.02F)
                      : kind < 0.7F ? Color(0.02F, 0.02F, 0.02F)
                                    : Color(0.09F, 0.09F, 0.09F);
  return {paint, point.normal};
}

// Dark backs and silver bellies, by the way the skin faces: fish move through the noise.
SurfaceLook fish_look(const SurfacePoint& point) {
  const Color back(0.12F, 0.14F, 0.15F), belly(0.62F, 0.62F, 0.58F);
  return {mix(belly, back, smooth_step(-0.2F, 0.6F, point.normal.z())), point.normal};
}

}  // namespace

SurfaceLook look_of(const SurfacePoint& point) {
  SurfaceLook look = point.material == Material::kGround ? ground_look(point)
                     : point.material == Material::kRock ? rock_look(point)
                     : point.material == Material::kSand ? sand_look(point)
                     : point.material == Material::kArm  ? arm_look(point)
                                                         : fish_look(point);
  look.albedo = look.albedo.max(0.01F).min(0.9F);
  return look;
}

}  // namespace hybrid_slam
