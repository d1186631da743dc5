#include "apps/scene_renderer/relief.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "apps/scene_renderer/noise.h"
#include "apps/scene_renderer/rows.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3f;

// Noise with the sharp crests and round valleys of eroded ground, 0 to about 1.
float crests(const Vector3f& p, float wavelength, std::uint32_t seed) {
  return 1 - 2.2F * std::abs(gradient_noise(p / wavelength, seed).value);
}

float height_at(float x, float y, const ReliefOptions& options, std::uint32_t seed) {
  const Vector3f p(x, y, 0);
  const Vector3f bend(gradient_noise(p / 0.9F, seed + 1).value,
                      gradient_noise(p / 0.9F, seed + 2).value, 0);
  const Vector3f q = p + 0.35F * bend;
  const float waves = octave_noise(q, {2.6F, 0.04F, 0.52F}, 0, seed + 3).value;
  const float broken = smooth_step(-0.1F, 0.4F, gradient_noise(p / 1.7F, seed + 4).value);
  const float ledges = 0.35F * crests(q, 0.8F, seed + 5) + 0.12F * crests(q, 0.23F, seed + 6);
  const float distance2 = (x * x + y * y) / (0.9F * 0.9F);
  const float height = options.roughness * (waves + 0.5F * broken * ledges) +
                       options.mound_height * std::exp(-distance2);
  if (options.ripple_height == 0) return height;
  return height + options.ripple_height * ripple_at(x, y, options, seed);
}

// Moves a point by noise in three dimensions, which lets steep ground hang over.
Vector3f pushed(const Vector3f& p, float strength, float wavelength, std::uint32_t seed) {
  return p + strength * Vector3f(gradient_noise(p / wavelength, seed).value,
                                 gradient_noise(p / wavelength, seed + 1).value,
                                 0.3F * gradient_noise(p / wavelength, seed + 2).value);
}

TriangleMesh make_ground(const ReliefOptions& options, std::uint32_t seed, int threads) {
  TriangleMesh mesh;
  const int n = options.grid;
  const bool is_sand = options.ripple_height > 0;
  // Cells grow outwards: position = inner * t in the middle, half_size at t = 1.
  const auto spread = [&](int i) {
    const float t = 2 * static_cast<float>(i) / static_cast<float>(n - 1) - 1;
    const float inner = 1.6F * options.detailed_size;
    return inner * t + (options.half_size - inner) * std::pow(t, 5.0F);
  };
  mesh.vertices.resize(static_cast<std::size_t>(n) * static_cast<std::size_t>(n));
  for_rows(n, threads, [&](int row) {
    for (int column = 0; column < n; ++column) {
      const float x = spread(column), y = spread(row);
      const Vector3f flat(x, y, height_at(x, y, options, seed));
      mesh.vertices[static_cast<std::size_t>(row * n + column)] =
          is_sand ? flat : pushed(flat, 0.2F, 0.4F, seed + 10);
    }
  });
  for (int row = 0; row + 1 < n; ++row) {
    for (int column = 0; column + 1 < n; ++column) {
      const auto a = static_cast<std::uint32_t>(row * n + column);
      const auto b = a + 1, c = a + static_cast<std::uint32_t>(n), d = c + 1;
      mesh.triangles.push_back({a, b, d});
      mesh.triangles.push_back({a, d, c});
    }
  }
  mesh.materials.assign(mesh.triangles.size(), is_sand ? Material::kSand : Material::kGround);
  mesh.seeds.assign(mesh.triangles.size(), seed);
  set_vertex_normals(mesh);
  return mesh;
}

Eigen::Quaternionf random_rotation(Counter& random, float tilt) {
  const auto turn = random.uniform(0, 2 * std::numbers::pi_v<float>);
  const auto about = random.uniform(0, 2 * std::numbers::pi_v<float>);
  const Vector3f axis(std::cos(about), std::sin(about), 0);
  return Eigen::AngleAxisf(random.uniform(-tilt, tilt), axis) *
         Eigen::AngleAxisf(turn, Vector3f::UnitZ());
}

// The shape of a boulder of radius 1: how far the surface lies in a direction of the unit sphere.
struct BoulderShape {
  Vector3f stretch;
  float lumps, crags, layers;
  std::uint32_t seed;

  Vector3f operator()(const Vector3f& direction) const {
    const float lump = octave_noise(direction, {1.1F, 0.2F, 0.5F}, 0, seed).value;
    const float crag = crests(direction, 0.5F, seed + 20) + 0.4F * crests(direction, 0.17F, seed);
    Vector3f p = direction * (1 + lumps * lump + crags * (crag - 0.7F));
    const float bend = 0.1F * gradient_noise(p, seed + 21).value;
    const float layer = std::abs(std::sin(14 * (p.z() + bend)));
    p.head<2>() *= 1 - layers * layer;  // strata weather back along their joints
    return p.cwiseProduct(stretch);
  }
};

BoulderShape random_shape(Counter& random, std::uint32_t seed) {
  const float kind = random.uniform();
  const auto side = [&](float low, float high) { return random.uniform(low, high); };
  if (kind < 0.4F) {  // worn round
    return {{side(0.8F, 1.15F), side(0.8F, 1.15F), side(0.6F, 0.95F)}, 0.35F, 0.05F, 0, seed};
  }
  if (kind < 0.75F) {  // craggy
    return {{side(0.75F, 1.2F), side(0.75F, 1.2F), side(0.7F, 1.1F)}, 0.5F, 0.3F, 0.03F, seed};
  }
  return {{side(1.1F, 1.5F), side(0.8F, 1.1F), side(0.22F, 0.35F)}, 0.4F, 0.1F, 0.07F, seed};
}

// Radii like those of broken rock: the share of those larger than r falls as r^-1.3.
float random_radius(Counter& random, const ReliefOptions& options) {
  const float all = std::pow(options.smallest_boulder, -1.3F);
  const float few = std::pow(options.largest_boulder, -1.3F);
  return std::pow(random.uniform(few, all), -1 / 1.3F);
}

// The unit sphere of `levels`, made once.
const TriangleMesh& sphere(int levels) {
  static const std::array<TriangleMesh, 6> spheres = [] {
    std::array<TriangleMesh, 6> all;
    for (int level = 0; level < 6; ++level) {
      all[static_cast<std::size_t>(level)] = make_icosphere(level, Material::kRock, 0);
    }
    return all;
  }();
  return spheres[static_cast<std::size_t>(levels)];
}

TriangleMesh make_boulder(int number, const ReliefOptions& options, std::uint32_t seed) {
  Counter random(seed, 1000 + number);
  // The first ones are large, so that every seed has its share of them.
  const float radius = number < options.boulders / 20
                           ? random.uniform(0.5F, 1.0F) * options.largest_boulder
                           : random_radius(random, options);
  const float angle = random.uniform(0, 2 * std::numbers::pi_v<float>);
  const float distance = options.boulder_area * std::sqrt(random.uniform());
  const float x = distance * std::cos(angle), y = distance * std::sin(angle);
  const float sunk = random.uniform(-0.35F, 0.25F) * radius;
  const Vector3f centre(x, y, height_at(x, y, options, seed) - sunk);
  const BoulderShape shape = random_shape(random, mixed_bits(number, 5, 9, seed));
  const Eigen::Quaternionf rotation = random_rotation(random, 0.6F);
  TriangleMesh mesh = sphere(radius > 0.13F ? 5 : radius > 0.045F ? 4 : 3);
  std::fill(mesh.seeds.begin(), mesh.seeds.end(), shape.seed);
  for (Vector3f& vertex : mesh.vertices) vertex = centre + radius * (rotation * shape(vertex));
  set_vertex_normals(mesh);
  return mesh;
}

}  // namespace

float ripple_at(float x, float y, const ReliefOptions& options, std::uint32_t seed) {
  const Vector3f p(x, y, 0);
  const float winding = 0.5F * gradient_noise(p / 1.1F, seed + 30).value +
                        0.15F * gradient_noise(p / 0.35F, seed + 31).value;
  const float phase = x / options.ripple_length + winding;
  const float wave = std::sin(2 * std::numbers::pi_v<float> * phase);
  return 0.5F + 0.5F * wave + 0.15F * (wave * wave - 1);  // crests narrower than troughs
}

TriangleMesh make_seafloor(const ReliefOptions& options, std::uint32_t seed, int threads) {
  TriangleMesh floor = make_ground(options, seed, threads);
  std::vector<TriangleMesh> boulders(static_cast<std::size_t>(options.boulders));
  for_rows(options.boulders, threads,
           [&](int i) { boulders[static_cast<std::size_t>(i)] = make_boulder(i, options, seed); });
  for (const TriangleMesh& boulder : boulders) floor.append(boulder);
  return floor;
}

}  // namespace hybrid_slam
