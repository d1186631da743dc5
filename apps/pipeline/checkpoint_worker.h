#pragma once

#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "apps/io/stage_times.h"
#include "apps/pipeline/channel.h"
#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

// Saves the map every so many keyframes, in a thread of its own, so that nobody waits for a disk.
class CheckpointWorker {
 public:
  // `save` returns what went wrong, empty if nothing did. Never saves if `every` is 0.
  CheckpointWorker(std::function<std::string(const MapSnapshot&)> save, int every);
  ~CheckpointWorker() { finish(); }

  // The map after one more keyframe. Never waits: of the maps that are due while one is being
  // saved, the last one follows. From one thread.
  void keyframe_added(std::shared_ptr<const MapSnapshot> map);

  // What went wrong since the last call. From any thread.
  std::vector<std::string> take_failures();

  // Waits for the map that is being saved; none follows.
  void finish();

  // After finish(): what the thread threw, if it did.
  void rethrow() const;

  // After finish().
  const StageTimes& times() const { return times_; }

 private:
  void work(const std::stop_token& stop);

  std::function<std::string(const MapSnapshot&)> save_;
  const int every_;
  int keyframes_ = 0;  // of the thread that tells of them
  Latest<MapSnapshot> maps_;
  std::mutex mutex_;
  std::vector<std::string> failures_;  // guarded by mutex_
  StageTimes times_;                   // the thread's own until finish()
  std::exception_ptr thrown_;          // likewise
  std::jthread thread_;
};

}  // namespace hybrid_slam
