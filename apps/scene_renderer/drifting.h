#pragma once

#include <cstdint>

#include "apps/scene_renderer/view_renderer.h"

// What drifts and swims in the water.
namespace hybrid_slam {

struct SnowOptions {
  float density = 250;                            // particles [1/m^3]
  float largest_radius = 0.0011F;                 // [m]
  Eigen::Vector3f drift{0.03F, 0.015F, -0.008F};  // [m/s]: current, and sinking
  float aperture = 0.0012F;                       // [m] of the lens: near particles are discs
  float focus = 1.2F;                             // [m] distance at which the lens is sharp
};

// Draws marine snow into an image: particles of the world at `time` [s], lit by the lamps, hidden
// by what is nearer. Every view of one moment sees the same particles.
void draw_snow(const SnowOptions& options, const SceneMoment& moment, const Lens& lens,
               const ViewRays& rays, const Rigid3d& world_from_cam, double time, std::uint32_t seed,
               RadianceImage& image);

// Fish that swim about the middle of the scene at `time` [s].
TriangleMesh make_fish(int count, double time, std::uint32_t seed);

}  // namespace hybrid_slam
