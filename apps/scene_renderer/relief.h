#pragma once

#include <cstdint>

#include "apps/scene_renderer/mesh.h"

namespace hybrid_slam {

struct ReliefOptions {
  float half_size = 9;         // [m] of the square of ground, its middle at the origin
  float detailed_size = 2;     // [m] half size of the part in the middle with the finest triangles
  int grid = 640;              // vertices along a side
  float mound_height = 0.22F;  // [m] of the mound in the middle
  float roughness = 0.2F;      // [m] height of the ground's longest waves
  int boulders = 480;
  float smallest_boulder = 0.03F;  // [m] radius
  float largest_boulder = 0.38F;   // [m]
  float boulder_area = 2.6F;       // [m] radius of the area that they lie in
  float ripple_height = 0;         // [m] of sand's ripples, trough to crest; 0: no sand
  float ripple_length = 0.13F;     // [m] from crest to crest, in the mean
};

// Ripples' crests lie across x, but wind. `x`, `y` [m]; 0 to 1.
float ripple_at(float x, float y, const ReliefOptions& options, std::uint32_t seed);

// A seafloor about z = 0, z up: relief of many octaves with overhanging places, and boulders
// (rounded, craggy, slabs) set into it; or sand with ripples, which hangs over nowhere. Depends on
// options and seed alone.
TriangleMesh make_seafloor(const ReliefOptions& options, std::uint32_t seed, int threads);

}  // namespace hybrid_slam
