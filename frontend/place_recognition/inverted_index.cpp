#include "frontend/place_recognition/inverted_index.h"

#include <algorithm>
#include <set>
#include <stdexcept>
#include <utility>

namespace hybrid_slam {

// Merges the words of both, which ascend.
InvertedIndex::Segment InvertedIndex::Segment::with(KeyframeId keyframe,
                                                    std::shared_ptr<const BowVector> bow) const {
  Segment grown;
  const auto slot = static_cast<std::uint32_t>(keyframes.size());
  grown.keyframes = keyframes;
  grown.keyframes.push_back(keyframe);
  grown.bows = bows;
  grown.words.reserve(words.size() + bow->size());
  grown.begin.reserve(words.size() + bow->size() + 1);
  grown.postings.reserve(postings.size() + bow->size());
  std::size_t word = 0;
  std::size_t entry = 0;
  while (word < words.size() || entry < bow->size()) {
    const bool of_segment =
        word < words.size() && (entry == bow->size() || words[word] <= (*bow)[entry].word);
    const NodeId next = of_segment ? words[word] : (*bow)[entry].word;
    grown.words.push_back(next);
    grown.begin.push_back(static_cast<std::uint32_t>(grown.postings.size()));
    if (of_segment) {
      grown.postings.insert(grown.postings.end(), postings.begin() + begin[word],
                            postings.begin() + begin[word + 1]);
      ++word;
    }
    if (entry < bow->size() && (*bow)[entry].word == next) {
      grown.postings.push_back({slot, (*bow)[entry++].weight});
    }
  }
  grown.begin.push_back(static_cast<std::uint32_t>(grown.postings.size()));
  grown.bows.push_back(std::move(bow));
  return grown;
}

InvertedIndex::Segment InvertedIndex::Segment::without(std::uint32_t slot) const {
  Segment rest;
  rest.keyframes = keyframes;
  rest.keyframes.erase(rest.keyframes.begin() + slot);
  rest.bows = bows;
  rest.bows.erase(rest.bows.begin() + slot);
  for (std::size_t word = 0; word < words.size(); ++word) {
    const std::size_t first = rest.postings.size();
    for (std::uint32_t i = begin[word]; i < begin[word + 1]; ++i) {
      if (postings[i].slot == slot) continue;
      rest.postings.push_back(
          {postings[i].slot - (postings[i].slot > slot ? 1U : 0U), postings[i].weight});
    }
    if (rest.postings.size() == first) continue;
    rest.words.push_back(words[word]);
    rest.begin.push_back(static_cast<std::uint32_t>(first));
  }
  rest.begin.push_back(static_cast<std::uint32_t>(rest.postings.size()));
  return rest;
}

// Both ascend by word.
void InvertedIndex::Segment::query(const BowVector& bow, std::span<SimilarKeyframe> by_slot) const {
  auto word = words.begin();
  for (const WordWeight& entry : bow) {
    while (word != words.end() && *word < entry.word) ++word;
    if (word == words.end()) return;
    if (*word != entry.word) continue;
    const auto at = static_cast<std::size_t>(word - words.begin());
    for (std::uint32_t i = begin[at]; i < begin[at + 1]; ++i) {
      by_slot[postings[i].slot].score += std::min(entry.weight, postings[i].weight);
      ++by_slot[postings[i].slot].shared_words;
    }
  }
}

std::uint32_t InvertedIndex::Segment::slot_of(KeyframeId keyframe) const {
  const auto found = std::find(keyframes.begin(), keyframes.end(), keyframe);
  return static_cast<std::uint32_t>(found - keyframes.begin());
}

void InvertedIndex::add(KeyframeId keyframe, BowVector bow) {
  if (contains(keyframe)) throw std::logic_error("inverted index: keyframe added twice");
  if (segments_.empty() || segments_.rbegin()->second->keyframes.size() >= kSegment) {
    const std::uint32_t next = segments_.empty() ? 0 : segments_.rbegin()->first + 1;
    segments_.emplace_hint(segments_.end(), next, std::make_shared<const Segment>());
  }
  auto& [number, newest] = *segments_.rbegin();
  newest = std::make_shared<const Segment>(
      newest->with(keyframe, std::make_shared<const BowVector>(std::move(bow))));
  segment_of_.emplace(keyframe, number);
}

void InvertedIndex::remove(KeyframeId keyframe) {
  const auto found = segment_of_.find(keyframe);
  if (found == segment_of_.end()) return;
  const auto segment = segments_.find(found->second);
  segment_of_.erase(found);
  if (segment->second->keyframes.size() == 1) {
    segments_.erase(segment);
    return;
  }
  segment->second =
      std::make_shared<const Segment>(segment->second->without(segment->second->slot_of(keyframe)));
}

const BowVector& InvertedIndex::bow(KeyframeId keyframe) const {
  const Segment& segment = *segments_.at(segment_of_.at(keyframe));
  return *segment.bows[segment.slot_of(keyframe)];
}

std::vector<SimilarKeyframe> InvertedIndex::query(const BowVector& bow,
                                                  std::span<const KeyframeId> excluded) const {
  std::vector<SimilarKeyframe> hits;
  for (const auto& [number, segment] : segments_) {
    std::vector<SimilarKeyframe> by_slot(segment->keyframes.size());
    segment->query(bow, by_slot);
    for (std::size_t slot = 0; slot < by_slot.size(); ++slot) {
      if (by_slot[slot].shared_words == 0) continue;
      by_slot[slot].keyframe = segment->keyframes[slot];
      hits.push_back(by_slot[slot]);
    }
  }
  const std::set<KeyframeId> out(excluded.begin(), excluded.end());
  std::erase_if(hits, [&](const SimilarKeyframe& hit) { return out.contains(hit.keyframe); });
  std::sort(hits.begin(), hits.end(), [](const SimilarKeyframe& a, const SimilarKeyframe& b) {
    return a.score != b.score ? a.score > b.score : a.keyframe < b.keyframe;
  });
  return hits;
}

}  // namespace hybrid_slam
