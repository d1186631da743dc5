#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "backend/map/loop_measurement.h"
#include "backend/map/map.h"
#include "backend/problem/loop_closure.h"

namespace hybrid_slam {

enum class LoopEnd {
  kClosed,
  kImplausible,  // the map cannot be bent to it at a plausible price; see close_loop()
  kGone,         // a keyframe of it is no longer in the map
};

// What became of a loop.
struct LoopOutcome {
  LoopEnd end = LoopEnd::kGone;
  double translation = 0;  // by which the loop's newer keyframe was off from it [m]
  double rotation = 0;     // [rad]
  double chi2 = 0;         // of the map bent to it
  int loops = 0;           // taken: more than one where others agreed with it
};

// A loop closed by steps: Backend::begin_close() makes it of a snapshot, run() finds how the map
// must move, in any thread, while the backend takes in keyframes, and Backend::end_close() moves
// it.
class LoopUpdate {
 public:
  void run();

  double seconds() const { return seconds_; }

 private:
  friend class Backend;
  LoopUpdate() = default;

  std::shared_ptr<const MapSnapshot> map_;  // null: there is nothing to close
  Map moved_;                               // branched there
  std::vector<PoseConstraint> loops_;       // that are not taken yet; the newest last
  std::vector<LoopEnds> closed_;
  LoopClosureOptions options_;
  LoopOutcome outcome_;
  LoopClosure closure_;
  double seconds_ = 0;
};

}  // namespace hybrid_slam
