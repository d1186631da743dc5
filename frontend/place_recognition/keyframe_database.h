#pragma once

#include <map>
#include <span>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "frontend/place_recognition/image_words.h"
#include "frontend/place_recognition/inverted_index.h"

namespace hybrid_slam {

// The keyframes of a map by what the vocabulary says about them: those of either camera that look
// like an image. One thread at a time.
class KeyframeDatabase {
 public:
  explicit KeyframeDatabase(Vocabulary vocabulary);

  // Takes in the keyframes that are new in the map and forgets those that are gone. Keyframes whose
  // descriptors are of another kind than the vocabulary's are never found.
  void follow(const MapSnapshot& map);

  bool knows(DescriptorKind kind) const { return kind == vocabulary_.kind(); }

  // Throws std::logic_error if the vocabulary does not know this kind of features.
  ImageWords words_of(const FeatureSet& features) const {
    return find_words(vocabulary_, features);
  }

  // Best first, `count` of them at most, without those in `excluded`.
  std::vector<SimilarKeyframe> similar(const BowVector& bow, std::size_t count,
                                       std::span<const KeyframeId> excluded) const;

  // Throws std::out_of_range for a keyframe that is not here.
  const DirectIndex& index_of(KeyframeId id) const { return indices_.at(id); }

  std::size_t size() const { return indices_.size(); }

 private:
  Vocabulary vocabulary_;
  InvertedIndex inverted_;
  std::map<KeyframeId, DirectIndex> indices_;
};

}  // namespace hybrid_slam
