#pragma once

#include "apps/io/graphs/graph_file.h"

namespace hybrid_slam {

// g2o graphs in space or in a plane, anything else is refused:
//   VERTEX_SE3:QUAT, EDGE_SE3:QUAT, EDGE_SE3_PRIOR, VERTEX_TRACKXYZ, EDGE_SE3_TRACKXYZ,
//   PARAMS_SE3OFFSET;  VERTEX_SE2, EDGE_SE2, EDGE_PRIOR_SE2, EDGE_PRIOR_SE2_XY, VERTEX_XY,
//   EDGE_SE2_XY;  FIX
// Vertices are world_from_body, frames their inverse. What FIX names is fixed and, of each part
// that no edge joins to the others and that holds neither a FIX nor a prior, the first vertex. An
// edge is a loop unless it leads from a vertex to the next one in the file.
//
// A plane is z = 0 of space. What a plane does not measure (z, roll, pitch) gets an information of
// the same order: by symmetry nothing in the plane depends on it.
// A prior is an edge from frame 0, "world", which is there if the file has priors, and fixed.
// Quaternions are normalised, with a warning where they are more than 1 % off unit length;
// informations are taken as far as they are positive: see g2o_information.h.
GraphFile read_g2o(const std::filesystem::path& path);

}  // namespace hybrid_slam
