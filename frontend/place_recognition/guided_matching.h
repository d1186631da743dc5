#pragma once

#include <vector>

#include "frontend/matching/brute_force.h"
#include "frontend/place_recognition/image_words.h"

namespace hybrid_slam {

// Matches between features that lie below the same node of the vocabulary: a fraction of all pairs,
// among which most of the right ones are. Nearest and second nearest are those below the node.
// Either index may lack features, which then take no part. The tests are those of `options`, equal
// distances go to the lower index; ascending by query. Throws std::logic_error if the two sets'
// descriptors are of different kinds.
std::vector<DescriptorMatch> match_guided(const FeatureSet& query, const DirectIndex& query_index,
                                          const FeatureSet& train, const DirectIndex& train_index,
                                          const BruteForceOptions& options);

}  // namespace hybrid_slam
