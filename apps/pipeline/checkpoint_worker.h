#pragma once

#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "apps/io/stage_times.h"
#include "apps/pipeline/channel.h"
#include "apps/pipeline/slam_run.h"

namespace hybrid_slam {

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
std::optional<RunFailure> save_checkpoint(const SaveMap& save, const MapSnapshot& map,
                                          StageTimes& times);

// Saves the map every so many keyframes, in a thread of its own, so that nobody waits for a disk.
class CheckpointWorker {
 public:
  CheckpointWorker(SaveMap save, int every);
  ~CheckpointWorker() { finish(); }

  // The map after one more keyframe. Never waits: of the maps that are due while one is being
  // saved, the last one follows. From one thread.
  void keyframe_added(std::shared_ptr<const MapSnapshot> map);

  // What went wrong since the last call. From any thread.
  std::vector<RunFailure> take_failures();

  // Waits for the map that is being saved; none follows.
  void finish();

  // After finish().
  const StageTimes& times() const { return times_; }

 private:
  void work();

  SaveMap save_;
  CheckpointSchedule schedule_;  // of the thread that tells of keyframes
  Latest<MapSnapshot> maps_;
  std::mutex mutex_;
  std::vector<RunFailure> failures_;  // guarded by mutex_
  StageTimes times_;                  // the thread's own until finish()
  std::jthread thread_;
};

}  // namespace hybrid_slam
