#pragma once

#include <functional>
#include <optional>

#include "apps/slam/live/live_cameras.h"
#include "apps/slam/live/set_recorder.h"
#include "apps/slam/replay.h"

namespace hybrid_slam {

// Beside the images.
struct LiveOptions {
  SessionOptions session;
  std::size_t limit = 0;  // sets; 0: until the source ends or `stop` is requested
  std::stop_token stop;  // ends the run in order: what came before is tracked, and the map adjusted
};

// Pushes the sets of a source through a session, those of `cameras.first` before all others, and
// what of them is whole into `recorder`, too, if there is one. `accepted` hears of each set that is
// pushed, as it is pushed. Goes on with `map`, if that is not empty.
RunResult run_live(SetSource& source, LiveCameras& cameras, const SlamOptions& options,
                   LiveOptions live, const ReplayHooks& hooks, SetRecorder* recorder,
                   const std::function<void(const Moment&)>& accepted, Map map = {});

}  // namespace hybrid_slam
