#pragma once

#include "apps/io/graphs/colmap_model.h"
#include "apps/io/graphs/graph_file.h"

namespace hybrid_slam {

// A COLMAP model (folder) as a graph: a frame per image, an observation per point in an image that
// has a point in space, with the pixel origin moved to the first pixel's centre; cameras as in
// colmap_cameras.h. The first image's pose is fixed; focal lengths and the distortion that a model
// has may be refined, shared by the images of a camera, but not the principal point.
//
// Written back: everything that was read, with poses, cameras, points, and the points' mean errors,
// of the estimate. Frames and rigs rule the images' poses, and images of one frame stay where they
// are on its rig: see colmap_rigs.h.
GraphFile read_colmap(const std::filesystem::path& folder, ColmapVariant variant);

}  // namespace hybrid_slam
