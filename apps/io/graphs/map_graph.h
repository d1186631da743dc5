#pragma once

#include "apps/io/graphs/graph_file.h"

namespace hybrid_slam {

// Whether a file claims to be a map file (docs/map_file.md).
bool is_map_file(const std::filesystem::path& path);

// A map: its keyframes as frames and its landmarks as points, each ascending by id and named by it.
// The origin is fixed, the cameras are known. What is written is the map that was read, moved.
GraphFile read_map_graph(const std::filesystem::path& path);

// Writes the graph of a file that is no map as one; none if a frame has no camera. What was
// measured is rounded to single precision. Descriptors are zero, of the kind "none". Points that
// neither two frames nor a stereo measurement see are left out, and of two measurements of a point
// in a frame the second.
std::optional<GraphWriter> make_map_writer(const GraphFile& file);

}  // namespace hybrid_slam
