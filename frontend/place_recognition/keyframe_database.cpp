#include "frontend/place_recognition/keyframe_database.h"

#include <algorithm>
#include <utility>

namespace hybrid_slam {

KeyframeDatabase::KeyframeDatabase(Vocabulary vocabulary)
    : vocabulary_(std::move(vocabulary)), inverted_(vocabulary_) {}

void KeyframeDatabase::follow(const MapSnapshot& map) {
  const std::vector<KeyframeId> born = map.keyframe_ids_from(next_);
  for (const KeyframeId id : born) add(map.at(id));
  // Ids only grow: where nothing was erased, the keyframes are those of before and the new ones.
  if (map.keyframe_count() != followed_ + born.size()) forget_erased(map);
  next_ = map.next_keyframe_id();
  followed_ = map.keyframe_count();
}

void KeyframeDatabase::add(const Keyframe& keyframe) {
  const FeatureSet& features = keyframe.observations->features;
  if (!knows(features.kind)) return;
  ImageWords words = words_of(features);
  inverted_.add(keyframe.id, words.bow);
  indices_.emplace(keyframe.id, std::move(words.index));
}

void KeyframeDatabase::forget_erased(const MapSnapshot& map) {
  for (auto entry = indices_.begin(); entry != indices_.end();) {
    if (map.find(entry->first) == nullptr) {
      inverted_.remove(entry->first);
      entry = indices_.erase(entry);
    } else {
      ++entry;
    }
  }
}

std::vector<SimilarKeyframe> KeyframeDatabase::similar(const BowVector& bow, std::size_t count,
                                                       std::span<const KeyframeId> excluded) const {
  std::vector<SimilarKeyframe> found = inverted_.query(bow, excluded);
  found.resize(std::min(found.size(), count));
  return found;
}

}  // namespace hybrid_slam
