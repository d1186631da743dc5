#include "apps/slam/loop_closing.h"

#include <utility>

namespace hybrid_slam {

namespace {

const char* outcome_of(LoopEnd end) {
  switch (end) {
    case LoopEnd::kClosed:
      return kLoopAccepted;
    case LoopEnd::kImplausible:
      return "implausible";
    case LoopEnd::kGone:
      break;
  }
  return "keyframe gone";
}

double time_of(const MapSnapshot& map, KeyframeId id) { return map.at(id).observations->time; }

}  // namespace

std::optional<LoopMeasurement> LoopClosing::find(const MapSnapshot& map, KeyframeId keyframe,
                                                 StageTimes& times) {
  StageClock clock(times);
  std::optional<LoopMeasurement> loop;
  for (LoopProposal& proposal : finder_.find(map, keyframe)) {
    LoopRecord record;
    record.keyframe = proposal.keyframe;
    record.match = proposal.match;
    record.time = time_of(map, proposal.keyframe);
    record.match_time = time_of(map, proposal.match);
    record.joins = map.component(proposal.keyframe) != map.component(proposal.match);
    loop = std::exchange(proposal.verification.loop, std::nullopt);
    record.outcome = loop ? "not closed" : to_string(proposal.verification.reason);
    record.verification = std::move(proposal.verification);
    if (loop) {
      open_ = std::move(record);
      break;
    }
    tell_(record);
  }
  clock.lap("find_loop");
  return loop;
}

void LoopClosing::closed(const LoopOutcome& outcome) {
  LoopRecord record = std::exchange(open_, std::nullopt).value();
  record.outcome = outcome_of(outcome.end);
  record.translation = outcome.translation;
  record.rotation = outcome.rotation;
  tell_(record);
}

void LoopClosing::finish() {
  if (open_) tell_(*open_);
  open_.reset();
}

}  // namespace hybrid_slam
