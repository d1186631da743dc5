#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace hybrid_slam {

// A landmark that may be condensed.
struct CondensableLandmark {
  std::int32_t clique = 0;           // of the tree, that holds its poses
  std::vector<std::uint32_t> poses;  // that vary, ascending; one at least
  std::uint32_t point = 0;
};

// A CondensedTerm that is there.
struct KnownGroup {
  std::int32_t clique = 0;
  std::uint32_t term = 0;
  std::vector<std::uint32_t> poses;  // ascending
  std::vector<std::size_t> views;    // of each landmark
};

// Landmarks that become one CondensedTerm, or join one, and the poses that see any in it,
// ascending.
struct CondensedGroup {
  static constexpr std::uint32_t kNew = static_cast<std::uint32_t>(-1);

  std::uint32_t term = kNew;
  std::vector<std::uint32_t> points;
  std::vector<std::uint32_t> poses;
};

// Landmarks of one clique that begin with the same pose go together. They join the group of their
// clique that grows the least by it, in memory, if that pays.
// No group takes more than `most_work` multiplications to be taken apart, unless a single
// landmark does.
std::vector<CondensedGroup> condensed_groups(std::vector<CondensableLandmark> landmarks,
                                             const std::vector<KnownGroup>& known,
                                             double most_work);

}  // namespace hybrid_slam
