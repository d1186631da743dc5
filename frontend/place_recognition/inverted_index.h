#pragma once

#include <cstddef>
#include <map>
#include <memory>
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
// others. For images of one vocabulary. Cheap to copy: a copy shares what is in it and does not see
// later changes, so that other threads can go on with it.
class InvertedIndex {
 public:
  // Throws std::logic_error if the keyframe is there already.
  void add(KeyframeId keyframe, BowVector bow);

  // No matter if it is not there.
  void remove(KeyframeId keyframe);

  bool contains(KeyframeId keyframe) const { return segment_of_.contains(keyframe); }
  std::size_t size() const { return segment_of_.size(); }

  // What was added. Throws std::out_of_range if it is not there. Valid until the next change.
  const BowVector& bow(KeyframeId keyframe) const;

  // The keyframes that share a word with the image, best first, of equal ones that of the lower id;
  // without those in `excluded`, which come in any order.
  std::vector<SimilarKeyframe> query(const BowVector& bow,
                                     std::span<const KeyframeId> excluded) const;

 private:
  struct Posting {
    std::uint32_t slot;
    float weight;
  };
  // Some keyframes and, by word, which of them contain it. Does not change; a change makes another
  // one, in a time that goes with its size.
  struct Segment {
    std::vector<KeyframeId> keyframes;
    std::vector<std::shared_ptr<const BowVector>> bows;
    std::vector<NodeId> words;         // ascending
    std::vector<std::uint32_t> begin;  // of each word's postings, and of what would be the next's
    std::vector<Posting> postings;

    Segment with(KeyframeId keyframe, std::shared_ptr<const BowVector> bow) const;
    Segment without(std::uint32_t slot) const;
    void query(const BowVector& bow, std::span<SimilarKeyframe> by_slot) const;
    std::uint32_t slot_of(KeyframeId keyframe) const;
  };
  static constexpr std::size_t kSegment = 64;  // keyframes in one, at most

  // By the number of the segment: full ones, whose keyframes come and go no more but to be removed,
  // and the newest.
  std::map<std::uint32_t, std::shared_ptr<const Segment>> segments_;
  std::map<KeyframeId, std::uint32_t> segment_of_;
};

}  // namespace hybrid_slam
