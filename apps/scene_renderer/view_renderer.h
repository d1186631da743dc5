#pragma once

#include <cstdint>
#include <vector>

#include "apps/scene_renderer/haze.h"
#include "apps/scene_renderer/ray_caster.h"

namespace hybrid_slam {

// What the cameras look at at one moment.
struct SceneMoment {
  const RayCaster* seafloor = nullptr;
  const RayCaster* movers = nullptr;  // fish and the arm; null: none about
  Lighting lighting;
};

// What a lens throws on its sensor, before the sensor.
struct RadianceImage {
  int width = 0;
  int height = 0;
  std::vector<Color> pixels;
  std::vector<float> distance;    // [m] to the nearest surface; infinity where there is none, or
                                  // outside the field of view
  std::vector<std::uint8_t> arm;  // 1 where any of a pixel's rays meets the arm; empty if none does
};

// Renders one view: four rays per pixel in two pairs that are symmetric about its centre, so that
// what a pixel shows lies at its centre. Their places depend on `seed` and the pixel alone, and so
// does the image: not on `threads`.
RadianceImage render_view(const SceneMoment& moment, const ViewRays& rays,
                          const Rigid3d& world_from_cam, std::uint32_t seed, int threads);

}  // namespace hybrid_slam
