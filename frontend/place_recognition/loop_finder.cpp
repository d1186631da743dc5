#include "frontend/place_recognition/loop_finder.h"

#include <stdexcept>
#include <utility>

namespace hybrid_slam {

std::string LoopFinderOptions::validate() const {
  const std::string error = detector.validate();
  return error.empty() ? verifier.validate() : error;
}

LoopFinder::LoopFinder(const Vocabulary& vocabulary, const LoopFinderOptions& options)
    : places_(vocabulary), detector_(options.detector), verifier_(options.verifier) {
  const std::string error = options.validate();
  if (!error.empty()) throw std::invalid_argument(error);
}

std::vector<LoopProposal> LoopFinder::find(const MapSnapshot& map, KeyframeId keyframe) {
  std::vector<LoopProposal> proposals;
  places_.follow(map);
  const Keyframe* there = map.find(keyframe);
  if (there == nullptr || !places_.knows(there->observations->features.kind)) return proposals;
  for (const KeyframeId match : detector_.detect(map, places_, keyframe)) {
    proposals.push_back({keyframe, match, verifier_.verify(map, keyframe, match, places_)});
    if (proposals.back().verification.loop) break;
  }
  return proposals;
}

}  // namespace hybrid_slam
