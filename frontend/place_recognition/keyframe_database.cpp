#include "frontend/place_recognition/keyframe_database.h"

#include <algorithm>
#include <utility>

namespace hybrid_slam {

KeyframeDatabase::KeyframeDatabase(Vocabulary vocabulary)
    : vocabulary_(std::move(vocabulary)), inverted_(vocabulary_) {}

void KeyframeDatabase::follow(const MapSnapshot& map) {
  for (auto entry = indices_.begin(); entry != indices_.end();) {
    if (map.find(entry->first) == nullptr) {
      inverted_.remove(entry->first);
      entry = indices_.erase(entry);
    } else {
      ++entry;
    }
  }
  for (const KeyframeId id : map.keyframe_ids()) {
    const FeatureSet& features = map.at(id).observations->features;
    if (!knows(features.kind) || indices_.contains(id)) continue;
    ImageWords words = words_of(features);
    inverted_.add(id, words.bow);
    indices_.emplace(id, std::move(words.index));
  }
}

std::vector<SimilarKeyframe> KeyframeDatabase::similar(const BowVector& bow, std::size_t count,
                                                       std::span<const KeyframeId> excluded) const {
  std::vector<SimilarKeyframe> found = inverted_.query(bow, excluded);
  found.resize(std::min(found.size(), count));
  return found;
}

}  // namespace hybrid_slam
