#pragma once

#include <span>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "frontend/place_recognition/image_words.h"
#include "frontend/place_recognition/inverted_index.h"

namespace hybrid_slam {

// The keyframes of a map by what the vocabulary says about them: those of either camera that look
// like an image. One thread at a time; cheap to copy, for others.
class KeyframeDatabase {
 public:
  explicit KeyframeDatabase(Vocabulary vocabulary);

  // Takes in the keyframes that are new in the map and forgets those that are gone. Keyframes whose
  // descriptors are of another kind than the vocabulary's are never found. The snapshots are of one
  // map, none older than the one before. Costs what is new; a look at each keyframe only where some
  // were erased.
  void follow(const MapSnapshot& map);

  bool knows(DescriptorKind kind) const { return kind == vocabulary_.kind(); }

  // Throws std::logic_error if the vocabulary does not know this kind of features.
  ImageWords words_of(const FeatureSet& features) const {
    return find_words(vocabulary_, features);
  }

  // Best first, `count` of them at most, without those in `excluded`.
  std::vector<SimilarKeyframe> similar(const BowVector& bow, std::size_t count,
                                       std::span<const KeyframeId> excluded) const;

  bool contains(KeyframeId id) const { return inverted_.contains(id); }

  // The words of a keyframe as it was when it came, kept: 8 bytes each, 10 KB for 2000 features or
  // so. Throws std::out_of_range for a keyframe that is not here; valid until the next follow().
  const BowVector& bow_of(KeyframeId id) const { return inverted_.bow(id); }

  // Of the features of a keyframe that have a landmark now. Not kept: to find it anew takes a
  // fraction of a millisecond. Throws std::logic_error if the vocabulary does not know their kind.
  DirectIndex index_of(const Keyframe& keyframe) const;

  std::size_t size() const { return inverted_.size(); }

 private:
  void add(const Keyframe& keyframe);
  void forget_erased(const MapSnapshot& map);

  Vocabulary vocabulary_;
  InvertedIndex inverted_;
  std::vector<KeyframeId> known_;  // ascending
  // Of the map as it was followed last; of its keyframes of any kind.
  KeyframeId next_{0};
  std::size_t followed_ = 0;
};

}  // namespace hybrid_slam
