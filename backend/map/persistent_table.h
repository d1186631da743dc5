#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <utility>

namespace hybrid_slam {

// A table from a dense index to a value, of which complete copies cost O(1): share() hands out a
// second table with the same content, and each of the two goes on independently. An edit copies
// only the path to its value (a radix trie of fan-out 32 whose values sit in boxes of their own, so
// that the 31 neighbours of an edited value are not copied).
//
// Which nodes may be written in place is decided by epochs: a node carries the epoch of its table
// in which it was made, and share() ends that epoch. A node made in the table's present epoch
// cannot be reached from any other table. Thread safety: that of a standard container; tables that
// share nodes may be used from different threads.
template <typename T>
class PersistentTable {
 public:
  PersistentTable() = default;
  PersistentTable(const PersistentTable&) = delete;
  PersistentTable& operator=(const PersistentTable&) = delete;
  PersistentTable(PersistentTable&&) noexcept = default;
  PersistentTable& operator=(PersistentTable&&) noexcept = default;

  // A table of the same content, in O(1). Not const: from here on, edits of this table copy.
  PersistentTable share() {
    ++epoch_;
    PersistentTable copy;
    copy.root_ = root_;
    copy.levels_ = levels_;
    copy.size_ = size_;
    copy.epoch_ = epoch_;
    return copy;
  }

  std::size_t size() const { return size_; }

  // Null where there is no value. Valid until the table changes.
  const T* find(std::uint64_t index) const {
    if (root_ == nullptr || out_of_reach(index)) return nullptr;
    const Node* node = root_.get();
    for (unsigned level = levels_; level-- > 0;) {
      node = static_cast<const Inner*>(node)->child[slot(index, level)].get();
      if (node == nullptr) return nullptr;
    }
    return &static_cast<const Box*>(node)->value;
  }

  // The value, to be written. Throws std::out_of_range where there is none. Valid until the next
  // share().
  T& edit(std::uint64_t index) {
    T* const value = edit_if(index);
    if (value == nullptr) throw std::out_of_range("PersistentTable::edit: no such index");
    return *value;
  }

  // The same, or null where there is none.
  T* edit_if(std::uint64_t index) {
    if (find(index) == nullptr) return nullptr;
    std::shared_ptr<Node>* node = &root_;
    for (unsigned level = levels_; level-- > 0;) {
      node = &own<Inner>(*node).child[slot(index, level)];
    }
    return &own<Box>(*node).value;
  }

  // Throws std::logic_error if the index is taken.
  T& insert(std::uint64_t index, T value) {
    if (find(index) != nullptr) throw std::logic_error("PersistentTable::insert: index is taken");
    while (root_ == nullptr || out_of_reach(index)) grow();
    std::shared_ptr<Node>* node = &root_;
    for (unsigned level = levels_; level-- > 0;) {
      if (*node == nullptr) *node = std::make_shared<Inner>(epoch_);
      node = &own<Inner>(*node).child[slot(index, level)];
    }
    auto box = std::make_shared<Box>(epoch_, std::move(value));
    T& stored = box->value;
    *node = std::move(box);
    ++size_;
    return stored;
  }

  // False if there was nothing to erase.
  bool erase(std::uint64_t index) {
    if (find(index) == nullptr) return false;
    erase_below(root_, levels_, index);
    --size_;
    return true;
  }

  // Calls f(index, const T&), ascending by index.
  template <typename F>
  void for_each(F&& f) const {
    if (root_ != nullptr) visit(*root_, levels_, 0, f);
  }

  // Calls f(index), ascending, where the values of this table and of one that was shared from it,
  // or it from that, may differ. Skips what the two still share.
  template <typename F>
  void for_each_change(const PersistentTable& other, F&& f) const {
    const unsigned level = std::max(levels_, other.levels_);
    compare({root_.get(), levels_}, {other.root_.get(), other.levels_}, level, 0, f);
  }

 private:
  static constexpr unsigned kBits = 5;
  static constexpr std::size_t kFanOut = std::size_t{1} << kBits;

  struct Node {
    explicit Node(std::uint64_t e) : epoch(e) {}
    std::uint64_t epoch;
  };
  struct Inner : Node {
    using Node::Node;
    std::array<std::shared_ptr<Node>, kFanOut> child;  // Inner, or Box on the lowest level
  };
  struct Box : Node {
    Box(std::uint64_t e, T v) : Node(e), value(std::move(v)) {}
    T value;
  };

  static std::size_t slot(std::uint64_t index, unsigned level) {
    return static_cast<std::size_t>(index >> (level * kBits)) & (kFanOut - 1);
  }

  bool out_of_reach(std::uint64_t index) const {
    return levels_ * kBits < 64 && (index >> (levels_ * kBits)) != 0;
  }

  void grow() {
    auto root = std::make_shared<Inner>(epoch_);
    root->child[0] = std::move(root_);
    root_ = std::move(root);
    ++levels_;
  }

  // The node in a slot of a node we own, replaced by a copy of ours if it may be shared.
  template <typename N>
  N& own(std::shared_ptr<Node>& node) {
    if (node->epoch != epoch_) {
      auto copy = std::make_shared<N>(static_cast<const N&>(*node));
      copy->epoch = epoch_;
      node = std::move(copy);
    }
    return static_cast<N&>(*node);
  }

  // Empties the slot of the value and of each node above it that holds nothing else.
  void erase_below(std::shared_ptr<Node>& node, unsigned level, std::uint64_t index) {
    if (level == 0) {
      node.reset();
      return;
    }
    Inner& inner = own<Inner>(node);
    erase_below(inner.child[slot(index, level - 1)], level - 1, index);
    for (const auto& child : inner.child) {
      if (child != nullptr) return;
    }
    node.reset();
    if (level == levels_) levels_ = 0;
  }

  template <typename F>
  static void visit(const Node& node, unsigned level, std::uint64_t index, F& f) {
    if (level == 0) {
      f(index, static_cast<const Box&>(node).value);
      return;
    }
    const Inner& inner = static_cast<const Inner&>(node);
    for (std::size_t i = 0; i < kFanOut; ++i) {
      if (inner.child[i] != nullptr) visit(*inner.child[i], level - 1, (index << kBits) | i, f);
    }
  }

  // A node, or null, and the level at which it stands: it covers the first indices of the levels
  // above.
  struct Place {
    const Node* node;
    unsigned level;

    Place below(std::size_t i, unsigned from) const {
      if (node == nullptr || level < from) return {i == 0 ? node : nullptr, level};
      return {static_cast<const Inner*>(node)->child[i].get(), from - 1};
    }
  };

  template <typename F>
  static void compare(Place a, Place b, unsigned level, std::uint64_t index, F& f) {
    if (a.node == b.node) return;
    if (level == 0) {
      f(index);
      return;
    }
    for (std::size_t i = 0; i < kFanOut; ++i) {
      compare(a.below(i, level), b.below(i, level), level - 1, (index << kBits) | i, f);
    }
  }

  std::shared_ptr<Node> root_;
  unsigned levels_ = 0;
  std::size_t size_ = 0;
  std::uint64_t epoch_ = 1;
};

}  // namespace hybrid_slam
