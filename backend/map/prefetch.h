#pragma once

#include <cstddef>

namespace hybrid_slam {

// Asks for memory that is read soon. A map is far larger than any cache, and what belongs to a
// landmark lies anywhere in it: a loop over landmarks that does not ask in time for those to come
// does little but wait.
inline void prefetch(const void* begin, std::size_t bytes) {
  constexpr std::size_t kCacheLine = 64;
  const char* const first = static_cast<const char*>(begin);
  for (std::size_t at = 0; at < bytes; at += kCacheLine) __builtin_prefetch(first + at);
}

// Null: nothing.
template <typename T>
void prefetch(const T* object) {
  if (object != nullptr) prefetch(object, sizeof(T));
}

// Elements of a container, span or matrix.
template <typename Range>
void prefetch_all(const Range& range) {
  prefetch(range.data(), static_cast<std::size_t>(range.size()) * sizeof(*range.data()));
}

// How many landmarks ahead: the work on so many takes about as long as memory does to answer.
constexpr std::size_t kPrefetchAhead = 6;

}  // namespace hybrid_slam
