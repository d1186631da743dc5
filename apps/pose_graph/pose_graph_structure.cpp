#include "apps/pose_graph/pose_graph_structure.h"

namespace hybrid_slam {

namespace {

// Disjoint sets of frames; each set is named by its lowest frame.
class ConnectedParts {
 public:
  explicit ConnectedParts(std::size_t frames) : parent_(frames) {
    for (std::size_t i = 0; i < frames; ++i) parent_[i] = i;
  }

  std::size_t part_of(std::size_t frame) {
    while (parent_[frame] != frame) {
      parent_[frame] = parent_[parent_[frame]];
      frame = parent_[frame];
    }
    return frame;
  }

  void join(std::size_t a, std::size_t b) {
    a = part_of(a);
    b = part_of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

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
