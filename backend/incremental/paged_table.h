#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

namespace hybrid_slam {

// A table from an index to a value, for indices that count up and of which old ones go: what stands
// side by side lies side by side, and a page of which all are gone is given back.
template <typename T>
class PagedTable {
 public:
  // Null where there is none. Valid until it is erased.
  const T* find(std::uint32_t index) const {
    const std::size_t page = index / kSize;
    if (page >= pages_.size() || pages_[page] == nullptr) return nullptr;
    return (pages_[page]->taken & bit(index)) != 0 ? &pages_[page]->values[index % kSize] : nullptr;
  }
  T* find(std::uint32_t index) { return const_cast<T*>(std::as_const(*this).find(index)); }

  // The value, and whether it is new.
  std::pair<T&, bool> try_emplace(std::uint32_t index) {
    if (T* const there = find(index)) return {*there, false};
    const std::size_t page = index / kSize;
    if (page >= pages_.size()) pages_.resize(page + 1);
    if (pages_[page] == nullptr) pages_[page] = std::make_unique<Page>();
    pages_[page]->taken |= bit(index);
    return {pages_[page]->values[index % kSize], true};
  }

  // Nothing where there is none.
  void erase(std::uint32_t index) {
    T* const there = find(index);
    if (there == nullptr) return;
    *there = T();
    std::unique_ptr<Page>& page = pages_[index / kSize];
    page->taken &= ~bit(index);
    if (page->taken == 0) page.reset();
  }

 private:
  static constexpr std::uint32_t kSize = 32;
  static constexpr std::uint32_t bit(std::uint32_t index) {
    return std::uint32_t{1} << (index % kSize);
  }

  struct Page {
    std::uint32_t taken = 0;  // a bit for each value
    std::array<T, kSize> values;
  };

  std::vector<std::unique_ptr<Page>> pages_;
};

}  // namespace hybrid_slam
