#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace hybrid_slam {

// Disjoint sets of a graph's nodes; each set is named by its lowest node.
class ConnectedParts {
 public:
  explicit ConnectedParts(std::size_t nodes) : parent_(nodes) {
    for (std::size_t i = 0; i < nodes; ++i) parent_[i] = i;
  }

  std::size_t part_of(std::size_t node) {
    while (parent_[node] != node) {
      parent_[node] = parent_[parent_[node]];
      node = parent_[node];
    }
    return node;
  }

  void join(std::size_t a, std::size_t b) {
    a = part_of(a);
    b = part_of(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

}  // namespace hybrid_slam
