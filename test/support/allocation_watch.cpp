#include "test/support/allocation_watch.h"

#include <algorithm>
#include <cstdlib>
#include <new>

namespace {

std::size_t largest_request = 0;

}  // namespace

void* operator new(std::size_t size) {
  largest_request = std::max(largest_request, size);
  void* const memory = std::malloc(std::max<std::size_t>(size, 1));
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace hybrid_slam {

AllocationWatch::AllocationWatch() { largest_request = 0; }

std::size_t AllocationWatch::largest() const { return largest_request; }

}  // namespace hybrid_slam
