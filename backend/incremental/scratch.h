#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace hybrid_slam {

// Room for numbers that are needed for a moment: on the stack where they are few, as those of a
// term mostly are, since otherwise allocating them is most of what a small factor costs.
template <typename T, std::size_t kFew>
class Scratch {
 public:
  explicit Scratch(std::size_t count) {
    if (count > kFew) many_.resize(count);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  T* data() { return many_.empty() ? few_.data() : many_.data(); }
  const T* data() const { return many_.empty() ? few_.data() : many_.data(); }

 private:
  std::array<T, kFew> few_;
  std::vector<T> many_;
};

}  // namespace hybrid_slam
