#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "backend/problem/factor_graph.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {

enum class GraphFormat {
  kBal,
  kG2o,
  kColmapText,
  kColmapBinary,
  kStereoGraph,
  kStereoStream,
  kMap,
  kPly,  // written only
};

inline constexpr std::array<GraphFormat, 8> kGraphFormats{
    GraphFormat::kBal,          GraphFormat::kG2o,         GraphFormat::kColmapText,
    GraphFormat::kColmapBinary, GraphFormat::kStereoGraph, GraphFormat::kStereoStream,
    GraphFormat::kMap,          GraphFormat::kPly};

std::string_view name_of(GraphFormat format);  // "bal", "g2o", "colmap-text", ...

// A way to write a graph: into `folder`, as "optimized" with the format's extension, or as a folder
// of this name. Returns what it has written. Throws OutputError.
struct GraphWriter {
  GraphFormat format = GraphFormat::kBal;
  std::function<std::filesystem::path(const FactorGraph& graph,
                                      const std::filesystem::path& folder)>
      write;
};

// A graph as it was read. What holds the gauge is fixed, and the intrinsics that an optimisation
// may refine are marked; see docs/map_optimizer.md for each format.
struct GraphFile {
  GraphFormat format = GraphFormat::kBal;
  FactorGraph graph;
  std::vector<std::string> frame_names;  // one per frame, as the file calls it
  std::vector<std::uint64_t> point_ids;  // one per point, as the file calls it
  // One per frame, or empty where the file has none:
  std::vector<double> times;                   // [s], ascending
  std::vector<Rigid3d> previous_from_current;  // odometry; the first is the identity
  std::vector<Rigid3d> true_cam_from_world;
  std::shared_ptr<const MapSnapshot> map;  // of a map file, as it was read; else null
  std::vector<std::string> warnings;       // what could be worked around
  // For graphs whose items are this graph's, moved: all but the estimate comes from the file that
  // was read. The first writes the format that was read.
  std::vector<GraphWriter> writers;
};

// Reads a file or folder in any format that is known, told by its content. Throws InputError with
// file and line where something is missing, malformed, not finite, out of range or of an unknown
// kind.
GraphFile read_graph(const std::filesystem::path& path);

}  // namespace hybrid_slam
