#include "test/frontend/pose/pnp_scene.h"

#include <cmath>

#include "test/support/random.h"

namespace hybrid_slam::pose_scene {
namespace {

struct Plane {
  Eigen::Vector3d normal;  // towards the plane
  double distance;         // [m]
};

// In front of the middle of the rays that the scene may use, tilted by at most 60 degrees.
Plane random_plane(const PnpSceneOptions& options, Random& random) {
  const double angle = 0.5 * (options.min_angle + std::min(options.max_angle, 1.2));
  const double azimuth = random.uniform(0, 2 * std::numbers::pi);
  const double axis_angle = options.min_angle > 0 ? angle : 0;
  const Eigen::Vector3d middle(std::sin(axis_angle) * std::cos(azimuth),
                               std::sin(axis_angle) * std::sin(azimuth), std::cos(axis_angle));
  for (;;) {
    const Eigen::Vector3d normal = random.direction();
    if (normal.dot(middle) > 0.5) return {normal, 0.5 * options.max_distance * normal.dot(middle)};
  }
}

Eigen::Vector2d random_pixel(const Camera& camera, Random& random) {
  const double u = random.uniform(0, image_width(camera) - 1);
  return {u, random.uniform(0, image_height(camera) - 1)};
}

Eigen::Vector3d random_point(const PnpSceneOptions& options, const Plane& plane, Random& random) {
  for (;;) {
    const auto ray = unproject(options.camera, random_pixel(options.camera, random));
    if (!ray) continue;
    const double angle = std::acos(ray->z());
    if (angle < options.min_angle || angle > options.max_angle) continue;
    if (!options.planar) {
      return *ray * random.uniform(options.min_distance, options.max_distance);
    }
    const double distance = plane.distance / ray->dot(plane.normal);
    if (distance > 0 && distance < 3 * options.max_distance) {
      const double height = options.thickness * random.uniform(-1, 1);
      return *ray * distance + height * plane.normal;
    }
  }
}

}  // namespace

PnpScene make_pnp_scene(const PnpSceneOptions& options) {
  Random random(options.seed);
  PnpScene scene{options.camera, random.rigid(20, 3), {}, {}};
  const Plane plane = random_plane(options, random);
  while (scene.observations.size() < static_cast<std::size_t>(options.count)) {
    const Eigen::Vector3d point = random_point(options, plane, random);
    const auto projected = project(options.camera, point);
    if (!projected) continue;
    const double sigma = random.uniform(options.sigma, std::max(options.sigma, options.max_sigma));
    const bool outlier = random.uniform() < options.outlier_share;
    Eigen::Vector2d pixel = random_pixel(options.camera, random);
    if (outlier) {
      while (!unproject(options.camera, pixel) || (pixel - *projected).norm() < 10 * sigma) {
        pixel = random_pixel(options.camera, random);
      }
    } else {
      pixel = *projected + sigma * Eigen::Vector2d(random.gaussian(), random.gaussian());
    }
    scene.observations.push_back(
        {inverse(scene.truth) * point, {pixel.x(), pixel.y(), kNaN}, sigma});
    scene.is_outlier.push_back(outlier);
  }
  return scene;
}

}  // namespace hybrid_slam::pose_scene
