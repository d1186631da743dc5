#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <thread>

#include "apps/io/stage_times.h"
#include "apps/slam/channel.h"
#include "apps/slam/session_types.h"

namespace hybrid_slam {

// Saves a map and returns what went wrong, empty if nothing did.
using SaveCheckpoint = std::function<std::string(const MapSnapshot&)>;

// When the map is saved on the way: every so many keyframes, never if that is 0.
class CheckpointSchedule {
 public:
  explicit CheckpointSchedule(int every) : every_(every) {}

  // To be asked once for each keyframe.
  bool due() { return every_ > 0 && ++keyframes_ % every_ == 0; }

 private:
  int every_;
  int keyframes_ = 0;
};

// Saves a checkpoint. What went wrong comes back, what `save` throws included; none if nothing did.
std::optional<SessionFailure> save_checkpoint(const SaveCheckpoint& save, const MapSnapshot& map,
                                              StageTimes& times);

// Saves the map every so many keyframes, in a thread of its own, so that nobody waits for a disk.
class CheckpointWorker {
 public:
  // `tell` hears of what goes wrong, in the worker's thread.
  CheckpointWorker(SaveCheckpoint save, int every, std::function<void(const SessionFailure&)> tell);
  ~CheckpointWorker() { finish(); }

  // The map after one more keyframe. Never waits: of the maps that are due while one is being
  // saved, the last one follows. From one thread.
  void keyframe_added(std::shared_ptr<const MapSnapshot> map);

  // Waits for the map that is being saved; none follows.
  void finish();

  // After finish().
  const StageTimes& times() const { return times_; }

 private:
  void work();

  SaveCheckpoint save_;
  CheckpointSchedule schedule_;  // of the thread that tells of keyframes
  Latest<MapSnapshot> maps_;
  std::function<void(const SessionFailure&)> tell_;
  StageTimes times_;  // the thread's own until finish()
  std::jthread thread_;
};

}  // namespace hybrid_slam
