#include <catch2/catch.hpp>

#include <cmath>
#include <numbers>

#include "apps/scene_renderer/noise.h"
#include "apps/scene_renderer/relief.h"
#include "apps/scene_renderer/scene_options.h"
#include "apps/scene_renderer/view_renderer.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kSlope = 0.3;  // of the plane z = kSlope x + 0.1

TriangleMesh make_plane() {
  TriangleMesh mesh;
  for (const float y : {-50.0F, 50.0F}) {
    for (const float x : {-50.0F, 50.0F}) {
      mesh.vertices.emplace_back(x, y, static_cast<float>(kSlope * x + 0.1));
    }
  }
  mesh.triangles = {{0, 1, 3}, {0, 3, 2}};
  mesh.materials.assign(2, Material::kGround);
  mesh.seeds.assign(2, 5);
  set_vertex_normals(mesh);
  return mesh;
}

double distance_to_plane(const Vector3d& origin, const Vector3d& direction) {
  const Vector3d normal(-kSlope, 0, 1);
  return (0.1 - normal.dot(origin)) / normal.dot(direction);
}

// Looks down, a little askew, from about 1.5 m.
Rigid3d camera_above() {
  const Eigen::Quaterniond down(Eigen::AngleAxisd(std::numbers::pi, Vector3d::UnitX()));
  const Eigen::Quaterniond askew(Eigen::AngleAxisd(0.4, Vector3d(0.6, 0.8, 0)));
  return {askew * down, Vector3d(0.2, -0.1, 1.5)};
}

// Signed volume inside a closed mesh whose triangles all face outwards.
double volume(const TriangleMesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vector3d pa = mesh.vertices[a].cast<double>(), pb = mesh.vertices[b].cast<double>();
    sum += pa.dot(pb.cross(mesh.vertices[c].cast<double>())) / 6;
  }
  return sum;
}

TEST_CASE("noise has the gradient it says, and no detail below the footprint") {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    const Vector3f p = random.vector(3, 20).cast<float>();
    const NoiseSample noise = gradient_noise(p, 7);
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3f step = 0.01F * Vector3f::Unit(axis);
      const float slope =
          (gradient_noise(p + step, 7).value - gradient_noise(p - step, 7).value) / 0.02F;
      CHECK(noise.gradient[axis] == Approx(slope).margin(2e-3));
    }
  }
  // The octaves are summed by other instructions, to the same result.
  for (int i = 0; i < 50; ++i) {
    const Vector3f p = random.vector(3, 2).cast<float>();
    NoiseSample sum;
    Vector3f shift(0.31F, 0.57F, 0.73F);
    float amplitude = 1;
    for (std::uint32_t octave = 0; octave < 11; ++octave) {
      const float wavelength = 0.8F / static_cast<float>(1U << octave);
      const NoiseSample one = gradient_noise(p / wavelength + shift, 7 + octave);
      sum.value += amplitude * one.value;
      sum.gradient += amplitude * one.gradient;
      amplitude *= 0.9F;
      shift += Vector3f(0.37F, 0.41F, 0.19F);
    }
    const NoiseSample octaves = octave_noise(p, {0.8F, 0.0007F, 0.9F}, 0, 7);
    CHECK(octaves.value == Approx(sum.value).margin(1e-4));
    CHECK((octaves.gradient - sum.gradient).norm() < 2e-3F);
  }
  const Vector3f p(0.3F, 1.2F, -0.4F);
  const Octaves octaves{1, 0.01F, 0.8F};
  CHECK(octave_noise(p, octaves, 0.5F, 3).value == 0);
  // Octaves that a coarse footprint can hold are the same for a fine one; what the fine one adds
  // is bounded by the amplitudes of the others.
  const float coarse = octave_noise(p, octaves, 0.02F, 3).value;
  const float fine = octave_noise(p, octaves, 0.001F, 3).value;
  CHECK(fine != coarse);
  CHECK(octave_noise(p, octaves, 0.001F, 3).value == fine);
  CHECK(octave_noise(p, octaves, 0.001F, 4).value != fine);
}

TEST_CASE("an icosphere is closed, faces outwards and comes near the sphere") {
  const TriangleMesh sphere = make_icosphere(4, Material::kRock, 0);
  CHECK(sphere.triangles.size() == 20 * 256);
  CHECK(sphere.vertices.size() == sphere.triangles.size() / 2 + 2);  // Euler: closed
  CHECK(volume(sphere) == Approx(4 * std::numbers::pi / 3).epsilon(0.01));
}

TEST_CASE("rays meet a plane where it is") {
  const RayCaster caster(make_plane(), 1);
  Random random(2);
  for (int i = 0; i < 500; ++i) {
    const Vector3d origin(random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(1.5, 3));
    std::array<Vector3f, kPacket> directions;
    for (Vector3f& direction : directions) {
      const Vector3d aim(random.uniform(-1, 1), random.uniform(-1, 1), -1.5);
      direction = aim.normalized().cast<float>();
    }
    const auto hits = caster.cast(origin.cast<float>(), directions);
    for (std::size_t k = 0; k < kPacket; ++k) {
      REQUIRE(hits[k]);
      const double truth = distance_to_plane(origin, directions[k].cast<double>());
      CHECK(hits[k]->distance == Approx(truth).epsilon(1e-5));
      CHECK(hits[k]->normal.dot(Vector3f(-0.3F, 0, 1).normalized()) > 0.99999F);
      const auto alone = caster.cast(origin.cast<float>(), directions[k]);
      REQUIRE(alone);
      CHECK(alone->distance == Approx(hits[k]->distance).epsilon(1e-6));
    }
    const Vector3f below(0, 0, -1), above(0, 0, 2);
    CHECK(caster.is_blocked(origin.cast<float>(), below, 0.01F));
    CHECK_FALSE(caster.is_blocked(origin.cast<float>(), above, 0.01F));
  }
  CHECK_FALSE(caster.cast(Vector3f(0, 0, 2), Vector3f::UnitZ()));
}

TEST_CASE("rays of pixels are those of the camera models, also between the centres") {
  const SceneCameras cameras = make_scene_cameras(320, 240);
  const auto& [fx, fy, cx, cy, baseline] = cameras.stereo.params;
  const Camera pinhole = Calibrated<Pinhole>{{fx, fy, cx, cy}, 320, 240};
  const Camera fisheye = cameras.fisheye;
  for (const Camera& camera : {pinhole, fisheye}) {
    const ViewRays rays = make_view_rays(camera, kFisheyeHalfAngle, 2);
    Random random(3);
    int seen = 0;
    for (int i = 0; i < 2000; ++i) {
      const int x = random.integer(0, rays.width - 1), y = random.integer(0, rays.height - 1);
      const auto pixel = static_cast<std::size_t>(y * rays.width + x);
      const auto centre = unproject(camera, {x, y});
      const auto angle = [&] { return std::atan2(centre->head<2>().norm(), centre->z()); };
      CHECK(rays.sees(pixel) == (centre && angle() <= kFisheyeHalfAngle));
      if (!rays.sees(pixel)) continue;
      ++seen;
      const double du = random.uniform(-0.5, 0.5), dv = random.uniform(-0.5, 0.5);
      const Vector3f bearing = rays.bearing[pixel] + static_cast<float>(du) * rays.right[pixel] +
                               static_cast<float>(dv) * rays.down[pixel];
      const auto back = project(camera, bearing.cast<double>());
      REQUIRE(back);
      CHECK(std::hypot(back->x() - x - du, back->y() - y - dv) < 4e-3);
    }
    CHECK(seen > 1000);
  }
}

TEST_CASE("a rendered plane lies at its analytic distance, in both kinds of cameras") {
  const RayCaster plane(make_plane(), 1);
  const SceneMoment moment{&plane, nullptr, {}};
  const SceneCameras cameras = make_scene_cameras(160, 120);
  const auto& [fx, fy, cx, cy, baseline] = cameras.stereo.params;
  const Camera pinhole = Calibrated<Pinhole>{{fx, fy, cx, cy}, 160, 120};
  const Camera fisheye = cameras.fisheye;
  const Rigid3d pose = camera_above();
  for (const Camera& camera : {pinhole, fisheye}) {
    const ViewRays rays = make_view_rays(camera, kFisheyeHalfAngle, 2);
    const RadianceImage image = render_view(moment, rays, pose, 1, 1);
    double worst = 0, sum = 0;
    int count = 0;
    for (int y = 0; y < rays.height; ++y) {
      for (int x = 0; x < rays.width; ++x) {
        const auto pixel = static_cast<std::size_t>(y * rays.width + x);
        const auto distance_at = [&](double u, double v) {
          return distance_to_plane(pose.translation(),
                                   pose.rotation() * *unproject(camera, {u, v}));
        };
        const double truth = distance_at(x, y);
        if (!rays.sees(pixel) || !(truth > 0 && truth < 4)) continue;
        // The nearest of the pixel's four rays: nearer than its centre by part of a half pixel.
        const double slant = std::abs(distance_at(x + 0.5, y) - distance_at(x - 0.5, y)) +
                             std::abs(distance_at(x, y + 0.5) - distance_at(x, y - 0.5));
        const double share = (truth - image.distance[pixel]) / (0.5 * slant + 1e-5);
        worst = std::max(worst, std::abs(share));
        sum += share;
        ++count;
      }
    }
    REQUIRE(count > 4000);
    CHECK(worst < 1.05);
    CHECK(sum / count > 0.2);
    CHECK(sum / count < 0.7);
  }
}

TEST_CASE("the seafloor depends on its seed, has relief, boulders and places that hang over") {
  ReliefOptions options;
  options.grid = 200;
  options.boulders = 60;
  const TriangleMesh floor = make_seafloor(options, 1, 2);
  CHECK(make_seafloor(options, 1, 1).vertices == floor.vertices);
  CHECK(make_seafloor(options, 2, 2).vertices != floor.vertices);
  int hanging_ground = 0, rock = 0;
  float low = 10, high = -10;
  for (std::size_t i = 0; i < floor.triangles.size(); ++i) {
    const auto& [a, b, c] = floor.triangles[i];
    const Vector3f normal =
        (floor.vertices[b] - floor.vertices[a]).cross(floor.vertices[c] - floor.vertices[a]);
    const bool is_rock = floor.materials[i] == Material::kRock;
    rock += is_rock ? 1 : 0;
    hanging_ground += !is_rock && normal.z() < 0 ? 1 : 0;
    low = std::min(low, floor.vertices[a].z());
    high = std::max(high, floor.vertices[a].z());
  }
  CHECK(rock > 60 * 20 * 64);
  CHECK(hanging_ground > 0);
  CHECK(high - low > 0.4F);
  CHECK(high < 1.1F);  // below the cameras
}

}  // namespace
}  // namespace hybrid_slam
