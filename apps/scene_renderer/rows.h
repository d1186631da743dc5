#pragma once

#include <functional>

#include "apps/slam/parallel_for.h"

namespace hybrid_slam {

// parallel_for over numbers of rows (or of anything else that is counted in int).
inline void for_rows(int count, int threads, const std::function<void(int)>& work) {
  parallel_for(static_cast<std::size_t>(count), threads,
               [&](std::size_t row, std::size_t) { work(static_cast<int>(row)); });
}

}  // namespace hybrid_slam
