#pragma once

#include <cstddef>
#include <functional>

#include "apps/slam/recorder.h"

namespace hybrid_slam {

// Pushes inputs into a session until there are no more, and tells the recorder of those that
// cannot be read.
using PushInputs = std::function<void(Session&, Recorder&)>;

// A session from its beginning to its end, and the books of it: what replaying files and listening
// to cameras have in common. Goes on with `map`, if that is not empty. `total`: of the moments to
// come, for whoever looks at the progress; 0: not known. When hooks.cancelled is requested the
// session ends at once, and `push` is to return.
RunResult recorded_run(const CameraRig& cameras, const SlamOptions& options, SessionOptions session,
                       const ReplayHooks& hooks, Map map, std::size_t total,
                       const PushInputs& push);

}  // namespace hybrid_slam
