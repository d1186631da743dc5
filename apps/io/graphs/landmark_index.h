#pragma once

#include <cstdint>
#include <unordered_map>
#include <unordered_set>
#include <vector>

namespace hybrid_slam {

// Numbers the landmarks of a file in the order in which they first appear.
class LandmarkIndex {
 public:
  struct Entry {
    std::uint32_t index = 0;
    bool is_new = false;
  };

  Entry insert(std::uint64_t id) {
    const auto [at, is_new] = index_.emplace(id, static_cast<std::uint32_t>(ids_.size()));
    if (is_new) ids_.push_back(id);
    return {at->second, is_new};
  }

  const std::vector<std::uint64_t>& ids() const { return ids_; }

 private:
  std::vector<std::uint64_t> ids_;
  std::unordered_map<std::uint64_t, std::uint32_t> index_;
};

// Finds observations that are made twice.
class ObservationSet {
 public:
  // False if it was there.
  bool insert(std::uint32_t frame, std::uint32_t point) {
    return seen_.insert(std::uint64_t{frame} << 32 | point).second;
  }

 private:
  std::unordered_set<std::uint64_t> seen_;
};

}  // namespace hybrid_slam
