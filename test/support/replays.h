#pragma once

#include <utility>

#include "apps/slam/replay.h"

namespace hybrid_slam {

inline RunResult run_every_frame(const FrameSource& source, const SlamOptions& options,
                                 ReplayOptions run, const ReplayHooks& hooks, Map map = {}) {
  run.session.mode = SessionMode::kEveryFrame;
  return replay(source, options, std::move(run), hooks, std::move(map));
}

inline RunResult run_realtime(const FrameSource& source, const SlamOptions& options,
                              ReplayOptions run, const ReplayHooks& hooks, Map map = {}) {
  run.session.mode = SessionMode::kRealtime;
  return replay(source, options, std::move(run), hooks, std::move(map));
}

}  // namespace hybrid_slam
