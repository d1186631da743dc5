#pragma once

#include <map>
#include <string>
#include <vector>

#include "frontend/place_recognition/keyframe_database.h"

namespace hybrid_slam {

// What follows is cheap and strict (geometry), so the defaults prefer recall: a lone track that
// crosses another shows it for three to five keyframes. docs/vocabulary.md has the measurements.
struct LoopDetectorOptions {
  // Least difference of the ids of a loop's ends, of all cameras; none between two components.
  int min_gap = 10;
  int max_shared_landmarks = 15;  // with so many in common, two keyframes are connected already
  // Of the most words that any candidate shares. An image with few features shares few words even
  // with itself, so this only drops what is hopeless.
  double min_word_share = 0.6;
  double min_base_ratio = 1.1;   // score against the base, which is that of unrelated images
  double min_score_share = 0.5;  // accumulated score above the base, against the best group's
  int consistency = 1;     // successive keyframes of one camera whose groups overlap; 1: none asked
  int max_candidates = 3;  // of different places, best first

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// Old keyframes that may show the place that a new one shows, of either camera, by words alone.
// The candidates of ORB-SLAM2 (Mur-Artal and Tardos, 2017): those that share enough words, then the
// best of each group of covisible keyframes whose accumulated score is near the best group's, then
// groups that overlap with those of the keyframes before.
//
// One thing differs. With a small vocabulary unrelated images share many words and score nearly as
// much as a revisit, so that a group would win by its size. What counts is therefore the score
// above the base: the lower quartile of all candidates, or, where they are fewer than ten, the
// score of the least similar covisible keyframe. ORB-SLAM2 asks for more than the latter's.
//
// One thread at a time.
class LoopDetector {
 public:
  // Throws std::logic_error if the options are not valid.
  explicit LoopDetector(const LoopDetectorOptions& options);

  // Candidates for a loop that ends in `keyframe`: older than it, in the map, not connected with
  // it and not covisible with one another; best first. `places` follows the map. To be asked once
  // for each keyframe of a camera, in their order. Empty for a keyframe that the map or the
  // vocabulary does not know.
  std::vector<KeyframeId> detect(const MapSnapshot& map, const KeyframeDatabase& places,
                                 KeyframeId keyframe);

 private:
  struct Group {
    KeyframeId best;  // the most similar one of the candidates in it
    double score = 0;
    std::vector<KeyframeId> members;  // `best` and what is covisible with it; ascending
    int successive = 1;               // keyframes in a row that led there
  };

  std::vector<SimilarKeyframe> candidates(const MapSnapshot& map, const KeyframeDatabase& places,
                                          const Keyframe& keyframe) const;
  std::vector<Group> groups(const MapSnapshot& map,
                            const std::vector<SimilarKeyframe>& candidates) const;

  LoopDetectorOptions options_;
  // By camera: the groups of its last keyframe. Ids only, so those erased meanwhile do no harm:
  // they are in no group that comes later.
  std::map<CameraId, std::vector<Group>> last_;
};

}  // namespace hybrid_slam
