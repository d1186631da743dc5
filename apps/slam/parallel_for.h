#pragma once

#include <cstddef>
#include <functional>

namespace hybrid_slam {

// One per core.
int default_thread_count();

// Calls work(i, worker) for every i below `count`, in up to `threads` threads of which each has a
// number `worker` below `threads` of its own, and waits for all. They begin in ascending order.
// After a call that threw no other begins, and what the one of the lowest i threw is thrown on.
void parallel_for(std::size_t count, int threads,
                  const std::function<void(std::size_t i, std::size_t worker)>& work);

}  // namespace hybrid_slam
