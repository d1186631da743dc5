#include "apps/scene_renderer/drifting.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "apps/scene_renderer/noise.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3f;

constexpr float kSnowCell = 0.2F;       // [m] of the lattice that holds the particles
constexpr float kSnowReach = 1.8F;      // [m] beyond which no particle is bright enough
constexpr float kNearestFlake = 0.05F;  // [m]
constexpr float kFlakeAlbedo = 0.6F;

struct Flake {
  Vector3f in_world;
  float radius;  // [m]
};

// Paints one flake: its light spread over a soft disc of at least a pixel.
void splat(float u, float v, float radius_px, float blur_px, const Color& radiance,
           float flake_distance, const ViewRays& rays, RadianceImage& image) {
  const float spread = std::sqrt(0.36F + radius_px * radius_px + blur_px * blur_px);
  const float cover = std::min(1.0F, radius_px * radius_px / (spread * spread));
  const int reach = static_cast<int>(std::ceil(1.6F * spread));
  const int cu = static_cast<int>(std::lround(u)), cv = static_cast<int>(std::lround(v));
  for (int y = std::max(0, cv - reach); y <= std::min(image.height - 1, cv + reach); ++y) {
    for (int x = std::max(0, cu - reach); x <= std::min(image.width - 1, cu + reach); ++x) {
      const auto pixel = static_cast<std::size_t>(y * image.width + x);
      if (!rays.sees(pixel) || image.distance[pixel] < flake_distance) continue;
      const float r = std::hypot(static_cast<float>(x) - u, static_cast<float>(y) - v) / spread;
      const float alpha = cover * (1 - smooth_step(0.6F, 1.5F, r));
      image.pixels[pixel] += alpha * (radiance - image.pixels[pixel]);
    }
  }
}

// Light that a flake sends to the camera.
Color flake_radiance(const Vector3f& in_world, float distance, const Lighting& lighting) {
  Color light = Color::Zero();
  for (const Lamp& lamp : lighting.lamps) light += irradiance(lamp, lighting.water, in_world);
  const float silt = silt_at(lighting.silt, in_world);
  return kFlakeAlbedo / std::numbers::pi_v<float> * light *
         exp_of(-distance * (lighting.water.attenuation + silt));
}

}  // namespace

void draw_snow(const SnowOptions& options, const SceneMoment& moment, const Lens& lens,
               const ViewRays& rays, const Rigid3d& world_from_cam, double time, std::uint32_t seed,
               RadianceImage& image) {
  const Rigid3d cam_from_world = inverse(world_from_cam);
  const Vector3f origin = world_from_cam.translation().cast<float>();
  const auto seconds = static_cast<float>(time);
  const Vector3f moved = seconds * options.drift;  // the lattice goes with the current
  const Eigen::Array3i first =
      ((origin - moved).array() / kSnowCell - kSnowReach / kSnowCell).floor().cast<int>();
  const Eigen::Array3i last =
      ((origin - moved).array() / kSnowCell + kSnowReach / kSnowCell).floor().cast<int>();
  const float mean_count = options.density * kSnowCell * kSnowCell * kSnowCell;

  const auto draw = [&](const Flake& flake) {
    const Eigen::Vector3d in_cam = cam_from_world * flake.in_world.cast<double>();
    const auto distance = static_cast<float>(in_cam.norm());
    if (distance < kNearestFlake || distance > kSnowReach) return;
    const auto place = lens.project(in_cam);
    if (!place || !in_image(lens.calibrated(), *place)) return;
    const auto u = static_cast<float>(place->x()), v = static_cast<float>(place->y());
    const auto pixel =
        static_cast<std::size_t>(std::lround(v)) * static_cast<std::size_t>(image.width) +
        static_cast<std::size_t>(std::lround(u));
    if (pixel >= image.pixels.size() || !rays.sees(pixel)) return;
    const float per_radian = 1 / rays.right[pixel].norm();
    const float blur =
        0.5F * options.aperture * per_radian * std::abs(1 / distance - 1 / options.focus);
    splat(u, v, flake.radius / distance * per_radian, blur,
          flake_radiance(flake.in_world, distance, moment.lighting), distance, rays, image);
  };

  for (int z = first.z(); z <= last.z(); ++z) {
    for (int y = first.y(); y <= last.y(); ++y) {
      for (int x = first.x(); x <= last.x(); ++x) {
        Counter random(mixed_bits(x, y, z, seed), 3);
        const int count = static_cast<int>(mean_count + random.uniform());
        for (int i = 0; i < count; ++i) {
          const Vector3f corner(static_cast<float>(x), static_cast<float>(y),
                                static_cast<float>(z));
          Vector3f place(random.uniform(), random.uniform(), random.uniform());
          // Each tumbles on a path of its own.
          const float phase = random.uniform(0, 6.28F), pace = random.uniform(0.2F, 0.9F);
          place += 0.08F * Vector3f(std::sin(phase + pace * seconds),
                                    std::cos(phase + 1.3F * pace * seconds),
                                    std::sin(2 * phase + 0.7F * pace * seconds));
          const float size = random.uniform();
          draw({kSnowCell * (corner + place) + moved,
                options.largest_radius * (0.15F + 0.85F * size * size * size)});
        }
      }
    }
  }
}

TriangleMesh make_fish(int count, double time, std::uint32_t seed) {
  TriangleMesh school;
  const auto seconds = static_cast<float>(time);
  for (int i = 0; i < count; ++i) {
    Counter random(seed, 5000 + i);
    const float length = random.uniform(0.05F, 0.12F), circle = random.uniform(0.4F, 1.1F);
    const float speed = random.uniform(0.08F, 0.2F) * (random.uniform() < 0.5F ? -1.0F : 1.0F);
    const float heading = random.uniform(0, 6.28F) + speed * seconds / circle;
    const Vector3f centre(random.uniform(-0.4F, 0.4F), random.uniform(-0.4F, 0.4F),
                          random.uniform(0.45F, 0.75F));
    const Vector3f outward(std::cos(heading), std::sin(heading), 0);
    const Vector3f ahead = (speed > 0 ? 1.0F : -1.0F) * Vector3f(-outward.y(), outward.x(), 0);
    const Vector3f side = Vector3f::UnitZ().cross(ahead);
    TriangleMesh body = make_icosphere(3, Material::kFish, static_cast<std::uint32_t>(i));
    for (Vector3f& p : body.vertices) {
      const float tail = smooth_step(-0.55F, -1, p.x());  // flat and high where the tail is
      const float height =
          0.3F * p.z() * (1 - 0.6F * smooth_step(0.1F, -0.7F, p.x())) * (1 + 5 * tail);
      const float beat = 0.12F * smooth_step(0.3F, -1, p.x()) *
                         std::sin(9 * seconds * (0.8F + circle) - 3 * p.x());
      const float width = 0.13F * p.y() * (1 - 0.8F * tail) + beat;
      p = centre + circle * outward + length * (p.x() * ahead + width * side) +
          length * height * Vector3f::UnitZ();
    }
    set_vertex_normals(body);
    school.append(body);
  }
  return school;
}

}  // namespace hybrid_slam
