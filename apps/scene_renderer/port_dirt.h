#pragma once

#include <cstdint>
#include <vector>

#include "apps/scene_renderer/view_renderer.h"

namespace hybrid_slam {

// Dirt on a port, by pixel: the share of the scene's light that it stops, 0 to 1. So near to the
// lens it is out of focus: soft blots that stand still in the image. Blots are added until those
// that stop a tenth or more cover `share` of the field of view.
std::vector<float> make_dirt(const ViewRays& rays, double share, std::uint32_t seed);

// Where dirt stops the scene, the lamps' stray light on it is seen: a third of the image's mean.
void apply_dirt(const std::vector<float>& dirt, RadianceImage& image);

}  // namespace hybrid_slam
