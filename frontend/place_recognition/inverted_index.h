#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <vector>

#include "backend/map/ids.h"
#include "frontend/place_recognition/image_words.h"

namespace hybrid_slam {

struct SimilarKeyframe {
  KeyframeId keyframe;
  double score = 0;  // bow_score, to the last digits of floats
  int shared_words = 0;
};

// Which keyframes contain a word: finds those that look like an image without a glance at the
// others. For images of one vocabulary.
class InvertedIndex {
 public:
  explicit InvertedIndex(const Vocabulary& vocabulary) : postings_(vocabulary.tables().nodes()) {}

  // Throws std::logic_error if the keyframe is there already.
  void add(KeyframeId keyframe, const BowVector& bow);

  // No matter if it is not there.
  void remove(KeyframeId keyframe);

  bool contains(KeyframeId keyframe) const { return slot_of_.contains(keyframe); }
  std::size_t size() const { return slot_of_.size(); }

  // What was added. Throws std::out_of_range if it is not there. Valid until the next change.
  const BowVector& bow(KeyframeId keyframe) const { return slots_[slot_of_.at(keyframe)].bow; }

  // The keyframes that share a word with the image, best first, of equal ones that of the lower id;
  // without those in `excluded`, which come in any order.
  std::vector<SimilarKeyframe> query(const BowVector& bow,
                                     std::span<const KeyframeId> excluded) const;

 private:
  struct Posting {
    std::uint32_t slot;
    float weight;
  };
  struct Slot {
    KeyframeId keyframe;  // invalid if free
    BowVector bow;
  };

  std::vector<std::vector<Posting>> postings_;  // one list per node
  std::vector<Slot> slots_;
  std::vector<std::uint32_t> free_slots_;
  std::map<KeyframeId, std::uint32_t> slot_of_;
};

}  // namespace hybrid_slam
