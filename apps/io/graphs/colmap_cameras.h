#pragma once

#include <vector>

#include "apps/io/graphs/colmap_model.h"
#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// The first pixel's centre in COLMAP's pixels, in both directions.
inline constexpr double kColmapFirstPixel = 0.5;

// Where a COLMAP camera is in the graph: among its cameras, or, of a model that these do not have,
// a block of its own. One that no image uses and no model of ours reads is nowhere.
struct ColmapCameraPlace {
  enum class Kind { kNone, kCamera, kBlock };

  Kind kind = Kind::kNone;
  std::uint32_t index = 0;
};

// Adds the cameras; pixels move by half a one, as the first pixel's centre is COLMAP's (0.5, 0.5).
// SIMPLE_PINHOLE, SIMPLE_RADIAL and RADIAL become Radial, PINHOLE Pinhole, OPENCV_FISHEYE
// KannalaBrandt; blocks are OPENCV and FULL_OPENCV (Rational), FOV (FieldOfView),
// SIMPLE_RADIAL_FISHEYE and RADIAL_FISHEYE (RadialFisheye), THIN_PRISM_FISHEYE (ThinPrismFisheye).
// Focal lengths and the distortion that a model has may vary, the principal point not. Throws
// InputError where a focal length is not positive, or an image has a camera that cannot be read.
std::vector<ColmapCameraPlace> add_colmap_cameras(const ColmapModel& model, FactorGraph& graph);

// A point seen in a frame by a camera that is a block.
GraphFactor block_observation(const ColmapCamera& camera, std::uint32_t block, std::uint32_t frame,
                              std::uint32_t point, const Eigen::Vector2d& pixel);

// The estimate, as COLMAP has it.
void take_colmap_camera(const FactorGraph& graph, const ColmapCameraPlace& place,
                        ColmapCamera& camera);

}  // namespace hybrid_slam
