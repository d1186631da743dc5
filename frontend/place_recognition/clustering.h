#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "backend/map/features.h"

namespace hybrid_slam {

// Calls body(0) .. body(count - 1), in any order or at once, and returns when all have returned.
// What is computed here does not depend on the order.
using ParallelFor =
    std::function<void(std::size_t count, const std::function<void(std::size_t)>& body)>;

// One after the other.
void serial_for(std::size_t count, const std::function<void(std::size_t)>& body);

struct ClusteringOptions {
  int clusters = 10;
  int max_iterations = 20;
  std::uint64_t seed = 0;
};

struct Cluster {
  Descriptor mean{};      // rounded to bytes
  std::size_t count = 0;  // of descriptors, at least 1
};

// k-means (Lloyd's iterations, k-means++ seeds from a sample). Reorders the descriptors cluster by
// cluster, each with the mean that is nearest, the first one of equals. All sums are of integers:
// the same result whatever `parallel` does. Fewer clusters if there are fewer different
// descriptors.
std::vector<Cluster> cluster_descriptors(std::span<Descriptor> descriptors,
                                         const ClusteringOptions& options,
                                         const ParallelFor& parallel);

}  // namespace hybrid_slam
