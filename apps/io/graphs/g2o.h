#pragma once

#include "apps/io/graphs/graph_file.h"

namespace hybrid_slam {

// g2o pose graphs in space: VERTEX_SE3:QUAT, EDGE_SE3:QUAT and FIX, anything else is refused.
// Vertices are world_from_body, frames their inverse. What FIX names is fixed, or else the first
// vertex. An edge is a loop unless it leads from a vertex to the next one in the file.
GraphFile read_g2o(const std::filesystem::path& path);

}  // namespace hybrid_slam
