#include "frontend/place_recognition/keyframe_database.h"

#include <algorithm>
#include <utility>

namespace hybrid_slam {

KeyframeDatabase::KeyframeDatabase(Vocabulary vocabulary) : vocabulary_(std::move(vocabulary)) {}

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
  inverted_.add(keyframe.id, words_of(features).bow);
  known_.push_back(keyframe.id);
}

void KeyframeDatabase::forget_erased(const MapSnapshot& map) {
  std::erase_if(known_, [&](KeyframeId id) {
    const bool gone = map.find(id) == nullptr;
    if (gone) inverted_.remove(id);
    return gone;
  });
}

DirectIndex KeyframeDatabase::index_of(const Keyframe& keyframe) const {
  std::vector<int> with_landmark;
  for (std::size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    if (keyframe.landmarks[i].valid()) with_landmark.push_back(static_cast<int>(i));
  }
  return find_index(vocabulary_, keyframe.observations->features, with_landmark);
}

std::vector<SimilarKeyframe> KeyframeDatabase::similar(const BowVector& bow, std::size_t count,
                                                       std::span<const KeyframeId> excluded) const {
  std::vector<SimilarKeyframe> found = inverted_.query(bow, excluded);
  found.resize(std::min(found.size(), count));
  return found;
}

}  // namespace hybrid_slam
