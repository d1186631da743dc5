#include "apps/pose_graph/pose_graph_structure.h"

#include "apps/pose_graph/connected_parts.h"

namespace hybrid_slam {

namespace {

std::vector<char> known_frames(const FactorGraph& graph) {
  ConnectedParts parts(graph.frames.size());
  for (const GraphEdge& edge : graph.edges) parts.join(edge.a, edge.b);
  std::vector<char> known(graph.frames.size(), 0);
  std::vector<char> part_is_held(graph.frames.size(), 0);
  for (std::size_t i = 0; i < known.size(); ++i) {
    known[i] = graph.frames[i].fixed;
    if (known[i]) part_is_held[parts.part_of(i)] = 1;
  }
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (parts.part_of(i) == i && !part_is_held[i]) known[i] = 1;
  }
  return known;
}

std::vector<BlockPattern::Coupling> couplings_of(const FactorGraph& graph) {
  std::vector<BlockPattern::Coupling> couplings;
  couplings.reserve(graph.edges.size());
  for (const GraphEdge& edge : graph.edges) couplings.emplace_back(edge.a, edge.b);
  return couplings;
}

}  // namespace

PoseGraphStructure::PoseGraphStructure(const FactorGraph& graph)
    : known(known_frames(graph)), couplings(couplings_of(graph)), pattern(couplings, known) {}

}  // namespace hybrid_slam
