#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace hybrid_slam {

struct Keyed {
  std::uint64_t key;
  std::uint32_t index;  // of what the key belongs to
};

// Ascending by key; equal keys keep their order. By digits of eight bits, the last first: no
// comparison whose outcome a processor would have to guess. Digits that all keys share cost
// nothing.
inline void sort_by_key(std::vector<Keyed>& items) {
  constexpr std::size_t kDigits = 8;
  constexpr std::size_t kValues = 256;
  const auto digit = [](std::uint64_t key, std::size_t i) {
    return static_cast<std::size_t>(key >> (8 * i)) % kValues;
  };
  std::array<std::array<std::uint32_t, kValues>, kDigits> places{};
  for (const Keyed& item : items) {
    for (std::size_t i = 0; i < kDigits; ++i) ++places[i][digit(item.key, i)];
  }
  std::vector<Keyed> sorted(items.size());
  for (std::size_t i = 0; i < kDigits; ++i) {
    auto& next = places[i];
    if (items.empty() || next[digit(items.front().key, i)] == items.size()) continue;
    std::uint32_t begin = 0;
    for (std::uint32_t& place : next) begin += std::exchange(place, begin);
    for (const Keyed& item : items) sorted[next[digit(item.key, i)]++] = item;
    items.swap(sorted);
  }
}

}  // namespace hybrid_slam
