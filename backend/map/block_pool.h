#pragma once

#include <cstddef>
#include <memory>
#include <mutex>

#include "backend/map/prefetch.h"

namespace hybrid_slam {

// Under the address sanitizer nothing is pooled: it would not see who reads what was given back.
#if defined(__SANITIZE_ADDRESS__)
inline constexpr bool kPooled = false;
#else
inline constexpr bool kPooled = true;
#endif

// Memory in blocks of one size, of which thousands come and go with each update of a map. A block
// that was given back is the next one that is taken: it need not be joined with what lies around
// it, nor looked for, both of which reads memory that is in no cache. What was once taken stays the
// pool's. Thread-safe.
class BlockPool {
 public:
  explicit BlockPool(std::size_t size) : size_(size) {}

  void* take() {
    const std::lock_guard lock(mutex_);
    if (free_ == nullptr) grow();
    Block* const block = free_;
    free_ = block->next;
    prefetch(free_);
    return block;
  }

  void give_back(void* memory) {
    const std::lock_guard lock(mutex_);
    free_ = new (memory) Block{free_};
  }

 private:
  static constexpr std::size_t kAtOnce = 64;

  struct Block {
    Block* next;
  };

  void grow() {
    auto* const memory = static_cast<std::byte*>(::operator new(kAtOnce* size_));
    for (std::size_t i = kAtOnce; i-- > 0;) free_ = new (memory + i * size_) Block{free_};
  }

  std::size_t size_;
  std::mutex mutex_;
  Block* free_ = nullptr;
};

// An allocator for std::allocate_shared, which takes objects one by one.
template <typename T>
class PoolAllocator {
 public:
  using value_type = T;

  PoolAllocator() = default;
  template <typename Other>
  explicit PoolAllocator(const PoolAllocator<Other>&) {}

  T* allocate(std::size_t count) {
    if (!kPooled || count != 1) return std::allocator<T>().allocate(count);
    return static_cast<T*>(pool().take());
  }
  void deallocate(T* memory, std::size_t count) {
    if (!kPooled || count != 1) return std::allocator<T>().deallocate(memory, count);
    pool().give_back(memory);
  }
  friend bool operator==(const PoolAllocator&, const PoolAllocator&) { return true; }

 private:
  // Never destroyed: maps may live as long as the program.
  static BlockPool& pool() {
    static_assert(alignof(T) <= __STDCPP_DEFAULT_NEW_ALIGNMENT__ && sizeof(T) >= sizeof(void*));
    static BlockPool* const pool = new BlockPool(sizeof(T));
    return *pool;
  }
};

}  // namespace hybrid_slam
