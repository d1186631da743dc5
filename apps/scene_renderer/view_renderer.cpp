#include "apps/scene_renderer/view_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "apps/scene_renderer/noise.h"
#include "apps/scene_renderer/rows.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3f;

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr float kShadowMargin = 0.004F;  // [m] at either end of a ray to a lamp

struct Sample {
  Vector3f direction;
  std::optional<RayHit> hit;
  const TriangleMesh* mesh = nullptr;  // that was hit

  Material material() const { return mesh->materials[hit->triangle]; }
  std::uint32_t seed() const { return mesh->seeds[hit->triangle]; }
};

using Samples = std::array<Sample, kPacket>;

// The view as one row of pixels after the other sees it.
class RowRenderer {
 public:
  RowRenderer(const SceneMoment& moment, const ViewRays& rays, const Haze& haze,
              const Rigid3d& world_from_cam, std::uint32_t seed)
      : moment_(moment),
        rays_(rays),
        haze_(haze),
        origin_(world_from_cam.translation().cast<float>()),
        rotation_(world_from_cam.rotation().toRotationMatrix().cast<float>()),
        seed_(seed) {}

  // Whether the view may show an arm.
  bool has_arm() const {
    if (moment_.movers == nullptr) return false;
    const auto& materials = moment_.movers->mesh().materials;
    return std::find(materials.begin(), materials.end(), Material::kArm) != materials.end();
  }

  void render(int y, RadianceImage& image) const {
    auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(rays_.width);
    for (int x = 0; x < rays_.width; ++x, ++pixel) {
      image.pixels[pixel] = Color::Zero();
      image.distance[pixel] = kInfinity;
      if (rays_.sees(pixel)) {
        image.pixels[pixel] = render_pixel(x, y, pixel, image);
      }
    }
  }

 private:
  Color render_pixel(int x, int y, std::size_t pixel, RadianceImage& image) const {
    const Vector3f origin = origin_of(pixel);
    const Samples samples = cast(x, y, pixel, origin);
    float& nearest = image.distance[pixel];
    for (const Sample& sample : samples) {
      if (!sample.hit) continue;
      nearest = std::min(nearest, sample.hit->distance);
      if (sample.material() == Material::kArm) image.arm[pixel] = 1;
    }
    const float angle = rays_.right[pixel].norm();
    const auto u = static_cast<float>(x), v = static_cast<float>(y);
    const std::uint32_t bits = mixed_bits(x, y, 1, seed_);
    if (is_one_surface(samples, angle)) {
      return shade(mean_of(samples), origin, u, v, angle, bits);
    }
    Color sum = Color::Zero();
    for (const Sample& sample : samples) sum += shade(sample, origin, u, v, angle, bits);
    return sum / kPacket;
  }

  Vector3f origin_of(std::size_t pixel) const {
    if (rays_.shift.empty()) return origin_;
    return origin_ + rays_.shift[pixel] * rotation_.col(2);
  }

  Samples cast(int x, int y, std::size_t pixel, const Vector3f& origin) const {
    const std::uint32_t bits = mixed_bits(x, y, 0, seed_);
    const auto part = [&](int i) {  // in [0, 0.5): one place in each quarter of the pixel
      return static_cast<float>((bits >> (8 * i)) & 255U) * (0.5F / 256);
    };
    const std::array<std::array<float, 2>, kPacket> places{
        {{part(0), part(1)}, {-part(0), -part(1)}, {part(2), -part(3)}, {-part(2), part(3)}}};
    std::array<Vector3f, kPacket> directions;
    for (std::size_t i = 0; i < kPacket; ++i) {
      const Vector3f bearing = rays_.bearing[pixel] + places[i][0] * rays_.right[pixel] +
                               places[i][1] * rays_.down[pixel];
      directions[i] = (rotation_ * bearing).normalized();
    }
    const auto hits = moment_.seafloor->cast(origin, directions);
    Samples samples;
    for (std::size_t i = 0; i < kPacket; ++i) {
      samples[i] = {directions[i], hits[i], &moment_.seafloor->mesh()};
    }
    if (moment_.movers != nullptr) {
      const auto movers = moment_.movers->cast(origin, directions);
      for (std::size_t i = 0; i < kPacket; ++i) {
        if (movers[i] && (!hits[i] || movers[i]->distance < hits[i]->distance)) {
          samples[i] = {directions[i], movers[i], &moment_.movers->mesh()};
        }
      }
    }
    return samples;
  }

  // Whether one look at the middle will do for all samples.
  static bool is_one_surface(const Samples& samples, float pixel_angle) {
    const Sample& first = samples[0];
    if (!first.hit) {
      return std::none_of(samples.begin(), samples.end(), [](const Sample& s) { return !!s.hit; });
    }
    const float slant = std::max(-first.direction.dot(first.hit->normal), 0.1F);
    const float reach = 2 * pixel_angle * first.hit->distance / slant;
    return std::all_of(samples.begin() + 1, samples.end(), [&](const Sample& other) {
      return other.hit && other.mesh == first.mesh && other.seed() == first.seed() &&
             std::abs(other.hit->distance - first.hit->distance) < reach &&
             other.hit->normal.dot(first.hit->normal) > 0.9F;
    });
  }

  static Sample mean_of(const Samples& samples) {
    Sample mean = samples[0];
    if (!mean.hit) return mean;
    for (std::size_t i = 1; i < kPacket; ++i) {
      mean.direction += samples[i].direction;
      mean.hit->distance += samples[i].hit->distance;
      mean.hit->normal += samples[i].hit->normal;
    }
    mean.direction.normalize();
    mean.hit->distance /= kPacket;
    mean.hit->normal.normalize();
    return mean;
  }

  // What comes into the lens from a sample's direction.
  Color shade(const Sample& sample, const Vector3f& origin, float u, float v, float pixel_angle,
              std::uint32_t bits) const {
    if (!sample.hit) return haze_.at(u, v, kInfinity).inscatter;
    const HazeSample haze = haze_.at(u, v, sample.hit->distance);
    if (haze.transmittance.maxCoeff() < 0.003F) return haze.inscatter;
    SurfacePoint point;
    point.position = origin + sample.hit->distance * sample.direction;
    point.normal = sample.hit->normal;
    point.material = sample.material();
    point.seed = sample.seed();
    const float slant = std::max(-sample.direction.dot(point.normal), 0.2F);
    // Between the lengths of the pixel's footprint across and along the slant.
    point.footprint = pixel_angle * sample.hit->distance / std::sqrt(slant);
    const SurfaceLook look = look_of(point);
    return look.albedo * light_on(point, look.normal, bits) * haze.transmittance + haze.inscatter;
  }

  // Radiance of a white surface.
  Color light_on(const SurfacePoint& point, const Vector3f& normal, std::uint32_t bits) const {
    const Water& water = moment_.lighting.water;
    Color light = water.ambient * (0.65F + 0.35F * normal.z()) * 3;
    for (const Lamp& lamp : moment_.lighting.lamps) {
      const Vector3f to_lamp = lamp.position - point.position;
      const float cosine = to_lamp.dot(normal) / to_lamp.norm();
      if (cosine <= 0 || to_lamp.dot(point.normal) <= 0) continue;
      const Color full = irradiance(lamp, water, point.position);
      if (full.maxCoeff() < 1e-4F || is_shadowed(point, lamp, bits)) continue;
      light += cosine / std::numbers::pi_v<float> * full;
    }
    return light;
  }

  // By a ray to a random place on the lamp's face.
  bool is_shadowed(const SurfacePoint& point, const Lamp& lamp, std::uint32_t bits) const {
    const Vector3f jitter(unit_interval(bits << 8) - 0.5F, unit_interval(bits << 16) - 0.5F,
                          unit_interval(bits << 24) - 0.5F);
    const Vector3f target = lamp.position + 2 * lamp.radius * jitter;
    const Vector3f start = point.position + 0.5F * kShadowMargin * point.normal;
    return moment_.seafloor->is_blocked(start, target, kShadowMargin) ||
           (moment_.movers != nullptr && moment_.movers->is_blocked(start, target, kShadowMargin));
  }

  const SceneMoment& moment_;
  const ViewRays& rays_;
  const Haze& haze_;
  const Vector3f origin_;
  const Eigen::Matrix3f rotation_;
  const std::uint32_t seed_;
};

}  // namespace

RadianceImage render_view(const SceneMoment& moment, const ViewRays& rays,
                          const Rigid3d& world_from_cam, std::uint32_t seed, int threads) {
  RadianceImage image{rays.width, rays.height, {}, {}, {}};
  image.pixels.resize(rays.bearing.size());
  image.distance.resize(rays.bearing.size());
  const Haze haze(moment.lighting, rays, world_from_cam, threads);
  const RowRenderer rows(moment, rays, haze, world_from_cam, seed);
  if (rows.has_arm()) image.arm.assign(rays.bearing.size(), 0);
  for_rows(rays.height, threads, [&](int y) { rows.render(y, image); });
  return image;
}

}  // namespace hybrid_slam
