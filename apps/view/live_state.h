#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "apps/slam/loop_closing.h"
#include "apps/view/live_frame.h"
#include "apps/view/live_map.h"

namespace hybrid_slam {

// What is kept of a run while it may be watched: bounded, however long it is. One thread.
class LiveState {
 public:
  explicit LiveState(std::string title) : title_(std::move(title)) {}

  // Of many frames half are forgotten now and then, as the report leaves them out.
  void add(LiveFrame frame);
  void add(const LoopRecord& loop);
  void add(const KeyframeResult& keyframe) { became_keyframe(keyframe, frames_); }

  const LiveFrame& newest() const { return frames_.back(); }

  // The event "state": the report's data as far as they are known on the way. `map` may be null.
  // `missed`: events that came too fast.
  nlohmann::ordered_json json(const MapSnapshot* map, const LiveSteps& steps,
                              std::size_t missed) const;

 private:
  std::string title_;
  std::vector<LiveFrame> frames_;
  std::size_t forgotten_ = 0;
  std::vector<LoopRecord> loops_;  // the newest
};

// An entry of the report's data, "loops".
nlohmann::ordered_json loop_json(const LoopRecord& loop);

}  // namespace hybrid_slam
