#pragma once

#include <map>
#include <memory>
#include <string>

#include "apps/slam/session_types.h"

namespace hybrid_slam {

// Writes into the log (apps/slam/log.h) what happens in a session, for an engineer who asks
// afterwards why tracking was lost, why a loop was refused, when mapping was behind. One thread at
// a time.
class SessionLog {
 public:
  // The given observers, with the log before them. The same ones if nothing is logged.
  static SessionObservers before(SessionObservers observers);

  void frame(const FrameResult& frame);
  void left_out(const LeftOut& input);
  void keyframe(const KeyframeResult& keyframe);
  void loop(const LoopRecord& loop);
  void map(const MapSnapshot& map, MapChange change);
  void failure(const SessionFailure& failure);

 private:
  struct Seen {
    TrackingState state = TrackingState::kStarting;
    std::string causes;  // their names
    bool mapping_behind = false;
    bool any = false;
  };
  void tell_state(const FrameResult& frame, Seen& seen);
  void tell_causes(const FrameResult& frame, Seen& seen);

  std::map<CameraKind, Seen> seen_;
  std::map<std::string, std::size_t> left_out_;  // by reason
};

}  // namespace hybrid_slam
