#include "apps/scene_renderer/view_rays.h"

#include <cmath>

#include "apps/scene_renderer/rows.h"

namespace hybrid_slam {
namespace {

std::optional<Eigen::Vector3d> bearing_within(const Camera& camera, double u, double v,
                                              double max_angle) {
  const auto bearing = unproject(camera, {u, v});
  if (!bearing || std::atan2(bearing->head<2>().norm(), bearing->z()) > max_angle) {
    return std::nullopt;
  }
  return bearing;
}

// Comes in from a pixel without a ray towards the middle until there is one.
Eigen::Vector3d nearest_bearing(const Camera& camera, double u, double v) {
  const double middle_u = 0.5 * image_width(camera), middle_v = 0.5 * image_height(camera);
  for (double share = 1; share > 0; share -= 0.02) {
    const auto bearing =
        unproject(camera, {middle_u + share * (u - middle_u), middle_v + share * (v - middle_v)});
    if (bearing) return *bearing;
  }
  return Eigen::Vector3d::UnitZ();
}

}  // namespace

ViewRays make_view_rays(const Camera& camera, double max_angle, int threads) {
  ViewRays rays;
  rays.width = image_width(camera);
  rays.height = image_height(camera);
  const auto count = static_cast<std::size_t>(rays.width) * static_cast<std::size_t>(rays.height);
  rays.bearing.assign(count, Eigen::Vector3f::Zero());
  rays.right = rays.bearing;
  rays.down = rays.bearing;
  for_rows(rays.height, threads, [&](int y) {
    auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(rays.width);
    for (int x = 0; x < rays.width; ++x, ++pixel) {
      const auto centre = bearing_within(camera, x, y, max_angle);
      const auto left = unproject(camera, {x - 0.5, y});
      const auto right = unproject(camera, {x + 0.5, y});
      const auto up = unproject(camera, {x, y - 0.5});
      const auto down = unproject(camera, {x, y + 0.5});
      if (!centre || !left || !right || !up || !down) continue;
      rays.bearing[pixel] = centre->cast<float>();
      rays.right[pixel] = (*right - *left).cast<float>();
      rays.down[pixel] = (*down - *up).cast<float>();
    }
  });
  rays.node_columns = (rays.width - 1) / kHazeCell + 2;
  rays.node_rows = (rays.height - 1) / kHazeCell + 2;
  for (int row = 0; row < rays.node_rows; ++row) {
    for (int column = 0; column < rays.node_columns; ++column) {
      const Eigen::Vector3d bearing = nearest_bearing(camera, column * kHazeCell, row * kHazeCell);
      rays.node_bearing.push_back(bearing.cast<float>());
    }
  }
  return rays;
}

}  // namespace hybrid_slam
