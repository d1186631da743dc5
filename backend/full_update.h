#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "backend/map/map.h"
#include "backend/problem/loop_correction.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

// A bundle adjustment of everything taken in by steps: Backend::begin_full() makes it of a
// snapshot, run() carries the result over what became of the map meanwhile, in any thread, while
// the backend takes in keyframes, and Backend::end_full() moves the map.
class FullUpdate {
 public:
  void run();

 private:
  friend class Backend;
  explicit FullUpdate(BundleResult result) : result_(std::move(result)) {}

  std::shared_ptr<const MapSnapshot> map_;  // null: the result is not taken in
  Map moved_;                               // branched there
  std::vector<LoopMove> moves_;             // by loops, since the adjustment's snapshot
  BundleResult result_;
};

}  // namespace hybrid_slam
