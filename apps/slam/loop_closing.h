#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "apps/io/stage_times.h"
#include "backend/backend.h"
#include "frontend/place_recognition/loop_finder.h"

namespace hybrid_slam {

// A place that was proposed as a loop, and what came of it.
struct LoopRecord {
  KeyframeId keyframe;
  KeyframeId match;
  double time = 0;                // [s] of the keyframe's frame
  double match_time = 0;          // [s]
  std::string outcome;            // kLoopAccepted, or the reason why it was rejected
  LoopVerification verification;  // without the loop
  double translation = 0;         // by which the map was off [m], if that was looked at
  double rotation = 0;            // [rad]
  bool joins = false;             // its ends lie in two components of the map, which it would join
};

inline constexpr const char* kLoopAccepted = "accepted";

// What happens for the loops of each new keyframe, but for what the map's owner does. Synchronous;
// one thread at a time.
class LoopClosing {
 public:
  // `tell` is called for each proposal, once it is known what came of it.
  LoopClosing(std::shared_ptr<KeyframeDatabase> places, const LoopFinderOptions& options,
              std::function<void(const LoopRecord&)> tell)
      : finder_(std::move(places), options), tell_(std::move(tell)) {}

  // A verified loop of this keyframe, to be closed by the map's owner, which then says what came
  // of it.
  std::optional<LoopMeasurement> find(const MapSnapshot& map, KeyframeId keyframe,
                                      StageTimes& times);
  void closed(const LoopOutcome& outcome);

  // A loop that nobody closed is told, too.
  void finish();

 private:
  LoopFinder finder_;
  std::function<void(const LoopRecord&)> tell_;
  std::optional<LoopRecord> open_;  // handed out, to be closed
};

}  // namespace hybrid_slam
