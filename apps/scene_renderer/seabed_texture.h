#pragma once

#include <cstdint>

#include <Eigen/Core>

#include "apps/scene_renderer/mesh.h"

namespace hybrid_slam {

using Color = Eigen::Array3f;  // linear red, green, blue

struct SurfacePoint {
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  // in the world [m]
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    // unit, of the mesh
  Material material = Material::kGround;
  std::uint32_t seed = 0;  // of its body
  float footprint = 0;     // [m] on the surface, of a pixel: nothing finer is drawn
};

struct SurfaceLook {
  Color albedo = Color::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // unit, with the relief that is only drawn
};

// What the seafloor looks like at a point: sediment, algae, pebbles, shells, rock with cracks and
// growth. A function of the place alone, so that every view sees the same, with detail at every
// scale down to the footprint and no repetition.
SurfaceLook look_of(const SurfacePoint& point);

}  // namespace hybrid_slam
