#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "backend/map/features.h"

namespace hybrid_slam {

struct BruteForceOptions {
  double max_descriptor_distance = 0.9;  // L2 between unit descriptors
  double ratio = 1.0;                    // best must be below ratio * second best; 1: no test
  bool mutual = true;                    // the query must also be the best of its match
};

struct DescriptorMatch {
  int query = 0;
  int train = 0;
  std::int32_t squared_distance = 0;  // of the bytes

  bool operator==(const DescriptorMatch&) const = default;
};

// The nearest and the second nearest train descriptor of one query, and back.
struct NearestNeighbours {
  std::vector<int> best;                      // one per query; -1 if there is no train descriptor
  std::vector<std::int32_t> best_distance;    // squared, of the bytes
  std::vector<std::int32_t> second_distance;  // squared; -1 if there is only one train descriptor
  std::vector<int> best_query;                // one per train descriptor; -1 if there is no query
};

// All pairs, exact. Equal distances go to the lower index, in both directions.
NearestNeighbours find_nearest(std::span<const Descriptor> query,
                               std::span<const Descriptor> train);

// Matches that pass the options' tests, ascending by query. Throws std::logic_error if the two
// sets' descriptors are of different kinds.
std::vector<DescriptorMatch> match_brute_force(const FeatureSet& query, const FeatureSet& train,
                                               const BruteForceOptions& options);

}  // namespace hybrid_slam
