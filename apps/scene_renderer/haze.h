#pragma once

#include <vector>

#include "apps/scene_renderer/view_rays.h"
#include "apps/scene_renderer/water.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// What the water does between a camera and a surface: the share of the surface's light that comes
// through, and the lamps' light that the water scatters into the ray.
struct HazeSample {
  Color transmittance = Color::Ones();
  Color inscatter = Color::Zero();
};

// The haze of one view: integrated along the rays of a coarse grid of pixels and at growing
// distances, interpolated between (haze is smooth).
class Haze {
 public:
  Haze(const Lighting& lighting, const ViewRays& rays, const Rigid3d& world_from_cam, int threads);

  // At pixel (x, y), up to a surface at `distance` [m]; infinity: no surface.
  HazeSample at(float x, float y, float distance) const;

 private:
  void integrate(const Lighting& lighting, const Eigen::Vector3f& origin,
                 const Eigen::Vector3f& direction, HazeSample* slices) const;

  int columns_ = 0;
  std::vector<HazeSample> nodes_;  // by row, column, slice
};

}  // namespace hybrid_slam
