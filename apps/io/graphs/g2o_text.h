#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "apps/io/graphs/g2o_information.h"
#include "apps/io/graphs/graph_file.h"

// What the text of a g2o file says, before ids are looked up.
namespace hybrid_slam {

enum class G2oItemKind { kSpacePose, kSpacePoint, kPlanePose, kPlanePoint, kOther };

// A line of the file. All but vertices are written as they were read.
struct G2oItem {
  G2oItemKind kind = G2oItemKind::kOther;
  std::uint32_t index = 0;  // of a vertex: among the frames or the points
  std::string text;         // of a vertex: tag and id
};

// A vertex: a frame or a point of the graph.
struct G2oNode {
  bool is_point = false;
  std::uint32_t index = 0;
};

// What the text says, before ids are looked up: a vertex may follow the edges that name it.
struct G2oEnds {
  std::uint64_t a = 0, b = 0;
  int line = 0;
};

struct G2oPointEdge {
  G2oEnds ends;
  std::uint64_t offset = 0;  // id
  bool has_offset = false;
  Eigen::Vector3d measured = Eigen::Vector3d::Zero();
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
};

struct G2oPrior {
  std::uint64_t vertex = 0;
  std::uint64_t offset = 0;  // id
  bool has_offset = false;
  int line = 0;
  Rigid3d world_from_sensor;
  Matrix6d information = Matrix6d::Zero();
};

struct G2oText {
  std::filesystem::path path;
  std::vector<G2oItem> items;  // all lines
  FactorGraph graph;           // frames and points as they come, edges without their ends
  std::vector<std::string> frame_names;
  std::vector<std::uint64_t> point_ids;
  std::unordered_map<std::uint64_t, G2oNode> nodes;    // by id
  std::unordered_map<std::uint64_t, Rigid3d> offsets;  // body_from_sensor, by id
  std::vector<G2oEnds> edge_ends;                      // by edge
  std::vector<G2oPointEdge> point_edges;
  std::vector<G2oPrior> priors;
  std::vector<std::pair<std::uint64_t, int>> fixed;  // id and line
  std::vector<std::string> warnings;                 // of informations and quaternions
};

// Throws InputError with the line where a tag is not known, a number missing, malformed or not
// finite, or items of a plane and of space are mixed.
G2oText read_g2o_text(const std::filesystem::path& path);

}  // namespace hybrid_slam
