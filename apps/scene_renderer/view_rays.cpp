#include "apps/scene_renderer/view_rays.h"

#include <cmath>

#include "apps/scene_renderer/rows.h"

namespace hybrid_slam {
namespace {

std::optional<LensRay> ray_within(const Lens& lens, double u, double v, double max_angle) {
  const auto ray = lens.unproject({u, v});
  if (!ray || std::atan2(ray->bearing.head<2>().norm(), ray->bearing.z()) > max_angle) {
    return std::nullopt;
  }
  return ray;
}

// Comes in from a pixel without a ray towards the middle until there is one.
Eigen::Vector3d nearest_bearing(const Lens& lens, double u, double v) {
  const double middle_u = 0.5 * image_width(lens.calibrated()),
               middle_v = 0.5 * image_height(lens.calibrated());
  for (double share = 1; share > 0; share -= 0.02) {
    const auto ray =
        lens.unproject({middle_u + share * (u - middle_u), middle_v + share * (v - middle_v)});
    if (ray) return ray->bearing;
  }
  return Eigen::Vector3d::UnitZ();
}

}  // namespace

ViewRays make_view_rays(const Lens& lens, double max_angle, int threads) {
  ViewRays rays;
  rays.width = image_width(lens.calibrated());
  rays.height = image_height(lens.calibrated());
  const auto count = static_cast<std::size_t>(rays.width) * static_cast<std::size_t>(rays.height);
  rays.bearing.assign(count, Eigen::Vector3f::Zero());
  rays.right = rays.bearing;
  rays.down = rays.bearing;
  if (lens.has_port()) rays.shift.assign(count, 0);
  for_rows(rays.height, threads, [&](int y) {
    auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(rays.width);
    for (int x = 0; x < rays.width; ++x, ++pixel) {
      const auto centre = ray_within(lens, x, y, max_angle);
      const auto left = lens.unproject({x - 0.5, y});
      const auto right = lens.unproject({x + 0.5, y});
      const auto up = lens.unproject({x, y - 0.5});
      const auto down = lens.unproject({x, y + 0.5});
      if (!centre || !left || !right || !up || !down) continue;
      rays.bearing[pixel] = centre->bearing.cast<float>();
      rays.right[pixel] = (right->bearing - left->bearing).cast<float>();
      rays.down[pixel] = (down->bearing - up->bearing).cast<float>();
      if (lens.has_port()) rays.shift[pixel] = static_cast<float>(centre->shift);
    }
  });
  rays.node_columns = (rays.width - 1) / kHazeCell + 2;
  rays.node_rows = (rays.height - 1) / kHazeCell + 2;
  for (int row = 0; row < rays.node_rows; ++row) {
    for (int column = 0; column < rays.node_columns; ++column) {
      const Eigen::Vector3d bearing = nearest_bearing(lens, column * kHazeCell, row * kHazeCell);
      rays.node_bearing.push_back(bearing.cast<float>());
    }
  }
  return rays;
}

}  // namespace hybrid_slam
