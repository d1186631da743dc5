#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/report/run_story.h"
#include "apps/slam/session_types.h"

namespace hybrid_slam {

// What is kept of a frame while a run is watched: its line of frames.csv, and through which
// keyframe it follows what becomes of the map: another one, or, once it became one, its own.
struct LiveFrame {
  RunFrame line;
  std::int64_t index = -1;  // FrameResult::index; -1: it was left out
  KeyframeId reference;     // invalid: it follows none
  Rigid3d cam_from_reference;
  double keyframes = kUnknown;  // of the map that it was tracked in
  double landmarks = kUnknown;
};

LiveFrame live_frame(const FrameResult& frame);
LiveFrame live_frame(const LeftOut& input);

// Of the newest such frame, if it is among them.
void became_keyframe(const KeyframeResult& keyframe, std::vector<LiveFrame>& frames);

// The event "frame": the values of frames.csv by their names there, the pose as position and
// rotation (x y z w). What frames.csv leaves empty is null.
nlohmann::ordered_json frame_json(const LiveFrame& live);

// The frames with their poses as `map` has them now; null: as they were told.
RunStory live_story(const std::vector<LiveFrame>& frames, const MapSnapshot* map);

}  // namespace hybrid_slam
