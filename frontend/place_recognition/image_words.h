#pragma once

#include <span>
#include <vector>

#include "frontend/place_recognition/vocabulary.h"

namespace hybrid_slam {

struct WordWeight {
  NodeId word = 0;
  float weight = 0;

  bool operator==(const WordWeight&) const = default;
};

// The words of an image, ascending, each weighted by how often it occurs times its idf (TF-IDF).
// The weights sum up to 1. Empty if the image has no word of any weight.
using BowVector = std::vector<WordWeight>;

// Features by the node of the vocabulary that guides matching: ascending by node, then by feature.
struct NodeFeature {
  NodeId node = 0;
  int feature = 0;

  bool operator==(const NodeFeature&) const = default;
};
using DirectIndex = std::vector<NodeFeature>;

// What a vocabulary says about an image.
struct ImageWords {
  BowVector bow;
  DirectIndex index;
};

// Throws std::logic_error if the features are of another kind than the vocabulary.
ImageWords find_words(const Vocabulary& vocabulary, const FeatureSet& features);

// The direct index of some of the features, ascending. Throws likewise.
DirectIndex find_index(const Vocabulary& vocabulary, const FeatureSet& features,
                       std::span<const int> some);

// The L1 score: 1 - |a - b| / 2, from 0 (no common word) to 1 (equal).
double bow_score(const BowVector& a, const BowVector& b);

}  // namespace hybrid_slam
