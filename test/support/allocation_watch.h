#pragma once

#include <cstddef>

namespace hybrid_slam {

// Tells what operator new was asked for while it lives. One at a time, one thread.
class AllocationWatch {
 public:
  AllocationWatch();
  std::size_t largest() const;  // [bytes] in one request
};

}  // namespace hybrid_slam
