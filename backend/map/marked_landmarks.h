#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "backend/map/ids.h"

namespace hybrid_slam {

// Landmarks, each once, however often it was marked.
class MarkedLandmarks {
 public:
  // Of a map whose next landmark gets the id `ids`.
  explicit MarkedLandmarks(std::uint32_t ids) : words_(ids / kBits + 1) {}

  // Whether it was not marked before. Nothing for one that there never was.
  bool mark(LandmarkId id) {
    if (id.value / kBits >= words_.size()) return false;
    std::uint64_t& word = words_[id.value / kBits];
    const std::uint64_t before = std::exchange(word, word | bit(id.value % kBits));
    return word != before;
  }

  // Ascending.
  template <typename F>
  void for_each(F&& f) const {
    for (std::size_t i = 0; i < words_.size(); ++i) {
      for (std::uint64_t left = words_[i]; left != 0; left &= left - 1) {
        const auto id = i * kBits + static_cast<std::size_t>(std::countr_zero(left));
        f(LandmarkId(static_cast<std::uint32_t>(id)));
      }
    }
  }

 private:
  static constexpr std::uint32_t kBits = 64;
  static constexpr std::uint64_t bit(std::uint32_t i) { return std::uint64_t{1} << i; }

  std::vector<std::uint64_t> words_;
};

}  // namespace hybrid_slam
