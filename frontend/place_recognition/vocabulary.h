#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "backend/map/features.h"

namespace hybrid_slam {

// A node of a vocabulary. 0 is the root; levels follow one another (breadth first), and so do the
// children of a node. A leaf is a word.
using NodeId = std::uint32_t;

using FloatDescriptor = std::array<float, 128>;

inline constexpr int kMaxBranching = 20;
inline constexpr int kMaxLevels = 10;  // below the root

// What a vocabulary consists of, wherever it lies.
struct VocabularyTables {
  DescriptorKind kind = DescriptorKind::kNone;
  int branching = 0;                        // children of a node, at most
  int levels = 0;                           // below the root, at most
  std::span<const NodeId> first_child;      // one per node and one more: the children of node i are
                                            // first_child[i] .. first_child[i + 1] - 1
  std::span<const float> weights;           // one per node; of a word, its idf
  std::span<const Descriptor> bytes;        // one per node, the mean of what is below it, or ...
  std::span<const FloatDescriptor> floats;  // ... in floats: plain SIFT as other programs train it

  std::size_t nodes() const { return weights.size(); }

  // Empty if this is a tree, else what is wrong.
  std::string validate() const;
};

// The kind's name in messages.
std::string_view kind_name(DescriptorKind kind);

// A tree of descriptors that turns a descriptor into a word (Nister and Stewenius, CVPR 2006).
// Immutable; copies share the tables. Safe in any thread.
class Vocabulary {
 public:
  // `owner` keeps the tables alive. Throws std::logic_error if they are no tree.
  Vocabulary(const VocabularyTables& tables, std::shared_ptr<const void> owner);

  const VocabularyTables& tables() const { return tables_; }
  DescriptorKind kind() const { return tables_.kind; }
  std::size_t words() const { return words_; }
  int depth() const { return static_cast<int>(level_begin_.size()) - 2; }  // of the deepest word
  // Nodes of a level, 0 .. depth(): [level_begin(level), level_begin(level + 1)).
  NodeId level_begin(int level) const { return level_begin_[static_cast<std::size_t>(level)]; }

  // The level whose nodes guide matching: the deepest one that has at most kMaxGuides nodes, so
  // that it fits the tree whatever its size.
  int guide_level() const { return guide_level_; }
  static constexpr NodeId kMaxGuides = 128;

  struct Place {
    NodeId word = 0;
    NodeId guide = 0;  // the node at guide_level() above the word, or the word if it is not below

    bool operator==(const Place&) const = default;
  };

  // Where descriptors lie in the tree: from the root down, the child whose mean is nearest, the
  // first one of equals. Throws std::logic_error if their kind is another.
  std::vector<Place> find(DescriptorKind kind, std::span<const Descriptor> descriptors) const;

 private:
  template <typename D>
  void descend(std::span<const D> descriptors, std::span<const D> means,
               std::span<Place> places) const;

  VocabularyTables tables_;
  std::shared_ptr<const void> owner_;
  std::vector<NodeId> level_begin_;
  std::size_t words_ = 0;
  int guide_level_ = 0;
};

}  // namespace hybrid_slam
