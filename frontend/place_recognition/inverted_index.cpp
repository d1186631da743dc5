#include "frontend/place_recognition/inverted_index.h"

#include <algorithm>
#include <stdexcept>

namespace hybrid_slam {

void InvertedIndex::add(KeyframeId keyframe, const BowVector& bow) {
  if (slot_of_.contains(keyframe)) throw std::logic_error("inverted index: keyframe added twice");
  std::uint32_t slot = static_cast<std::uint32_t>(slots_.size());
  if (free_slots_.empty()) {
    slots_.emplace_back();
  } else {
    slot = free_slots_.back();
    free_slots_.pop_back();
  }
  slots_[slot] = {keyframe, bow};
  slot_of_.emplace(keyframe, slot);
  for (const WordWeight& entry : bow) {
    postings_.at(entry.word).push_back({slot, entry.weight});
  }
}

void InvertedIndex::remove(KeyframeId keyframe) {
  const auto found = slot_of_.find(keyframe);
  if (found == slot_of_.end()) return;
  const std::uint32_t slot = found->second;
  for (const WordWeight& entry : slots_[slot].bow) {
    std::erase_if(postings_[entry.word],
                  [&](const Posting& posting) { return posting.slot == slot; });
  }
  slots_[slot] = {};
  free_slots_.push_back(slot);
  slot_of_.erase(found);
}

std::vector<SimilarKeyframe> InvertedIndex::query(const BowVector& bow,
                                                  std::span<const KeyframeId> excluded) const {
  std::vector<SimilarKeyframe> by_slot(slots_.size());
  for (const WordWeight& entry : bow) {
    for (const Posting& posting : postings_.at(entry.word)) {
      by_slot[posting.slot].score += std::min(entry.weight, posting.weight);
      ++by_slot[posting.slot].shared_words;
    }
  }
  for (const KeyframeId keyframe : excluded) {
    const auto found = slot_of_.find(keyframe);
    if (found != slot_of_.end()) by_slot[found->second].shared_words = 0;
  }
  for (std::size_t i = 0; i < by_slot.size(); ++i) by_slot[i].keyframe = slots_[i].keyframe;
  std::erase_if(by_slot, [](const SimilarKeyframe& hit) { return hit.shared_words == 0; });
  std::sort(by_slot.begin(), by_slot.end(), [](const SimilarKeyframe& a, const SimilarKeyframe& b) {
    return a.score != b.score ? a.score > b.score : a.keyframe < b.keyframe;
  });
  return by_slot;
}

}  // namespace hybrid_slam
