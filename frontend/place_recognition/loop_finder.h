#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frontend/place_recognition/keyframe_database.h"
#include "frontend/place_recognition/loop_detector.h"
#include "frontend/place_recognition/loop_verifier.h"

namespace hybrid_slam {

struct LoopFinderOptions {
  LoopDetectorOptions detector;
  LoopVerifierOptions verifier;

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// A place that was proposed for a keyframe, and what geometry says of it.
struct LoopProposal {
  KeyframeId keyframe;
  KeyframeId match;
  LoopVerification verification;
};

// Looks for the places of new keyframes among the older ones: words propose, geometry decides. One
// thread at a time.
class LoopFinder {
 public:
  // `places` may have other users in the same thread. Throws std::invalid_argument if the options
  // are not valid.
  LoopFinder(std::shared_ptr<KeyframeDatabase> places, const LoopFinderOptions& options);

  // To be called once for each new keyframe, in their order. What was examined, best first, up to
  // and including the first that is a loop. Without one, a loop of a keyframe before it that only
  // missed a neighbour to confirm it, if the new one does. Nothing for a keyframe that has gone, or
  // whose descriptors the vocabulary does not know.
  std::vector<LoopProposal> find(const MapSnapshot& map, KeyframeId keyframe);

 private:
  struct Ends {
    KeyframeId keyframe;
    KeyframeId match;
  };

  std::optional<LoopProposal> confirm_earlier(const MapSnapshot& map, KeyframeId keyframe);

  std::shared_ptr<KeyframeDatabase> places_;
  LoopDetector detector_;
  LoopVerifier verifier_;
  int min_shared_landmarks_;       // that make two keyframes neighbours
  std::vector<Ends> unconfirmed_;  // of the newest keyframes
};

}  // namespace hybrid_slam
