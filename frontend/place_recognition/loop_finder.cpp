#include "frontend/place_recognition/loop_finder.h"

#include <stdexcept>
#include <utility>

#include "backend/map/covisibility.h"

namespace hybrid_slam {
namespace {

constexpr int kMaxUnconfirmed = 6;  // looked at again with each new keyframe: bounds the work

}  // namespace

std::string LoopFinderOptions::validate() const {
  const std::string error = detector.validate();
  return error.empty() ? verifier.validate() : error;
}

LoopFinder::LoopFinder(std::shared_ptr<KeyframeDatabase> places, const LoopFinderOptions& options)
    : places_(std::move(places)),
      detector_(options.detector),
      verifier_(options.verifier),
      min_shared_landmarks_(options.verifier.min_shared_landmarks) {
  const std::string error = options.validate();
  if (!error.empty()) throw std::invalid_argument(error);
}

std::vector<LoopProposal> LoopFinder::find(const MapSnapshot& map, KeyframeId keyframe) {
  std::vector<LoopProposal> proposals;
  places_->follow(map);
  const Keyframe* there = map.find(keyframe);
  if (there == nullptr || !places_->knows(there->observations->features.kind)) return proposals;
  std::vector<Ends> unconfirmed;
  for (const KeyframeId match : detector_.detect(map, *places_, keyframe)) {
    proposals.push_back({keyframe, match, verifier_.verify(map, keyframe, match, *places_)});
    if (proposals.back().verification.loop) {
      unconfirmed_.clear();
      return proposals;
    }
    if (proposals.back().verification.reason == LoopRejection::kUnconfirmed) {
      unconfirmed.push_back({keyframe, match});
    }
  }
  if (auto loop = confirm_earlier(map, keyframe)) proposals.push_back(std::move(*loop));
  unconfirmed_.insert(unconfirmed_.end(), unconfirmed.begin(), unconfirmed.end());
  if (unconfirmed_.size() > kMaxUnconfirmed) {
    unconfirmed_.erase(unconfirmed_.begin(), unconfirmed_.end() - kMaxUnconfirmed);
  }
  return proposals;
}

// A lone track that crosses another may see it in two keyframes only, of which the first has no
// neighbour that does.
std::optional<LoopProposal> LoopFinder::confirm_earlier(const MapSnapshot& map,
                                                        KeyframeId keyframe) {
  const Keyframe& newest = map.at(keyframe);
  std::erase_if(unconfirmed_, [&](const Ends& ends) {
    return shared_landmarks(newest, ends.keyframe) < min_shared_landmarks_;
  });
  for (const Ends& ends : unconfirmed_) {
    LoopVerification found = verifier_.verify(map, ends.keyframe, ends.match, *places_);
    if (!found.loop) continue;
    unconfirmed_.clear();
    return LoopProposal{ends.keyframe, ends.match, std::move(found)};
  }
  return {};
}

}  // namespace hybrid_slam
