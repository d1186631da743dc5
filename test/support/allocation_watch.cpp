#include "test/support/allocation_watch.h"

#include <algorithm>
#include <cstdlib>
#include <new>

namespace {

std::size_t largest_request = 0;

}  // namespace

// All forms for single objects: a sanitizer has its own of each, which must not meet ours.

void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  largest_request = std::max(largest_request, size);
  return std::malloc(std::max<std::size_t>(size, 1));
}

void* operator new(std::size_t size) {
  void* const memory = operator new(size, std::nothrow);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }

namespace hybrid_slam {

AllocationWatch::AllocationWatch() { largest_request = 0; }

std::size_t AllocationWatch::largest() const { return largest_request; }

}  // namespace hybrid_slam
