#pragma once

#include <atomic>
#include <exception>
#include <functional>
#include <thread>
#include <utility>
#include <variant>

#include "apps/slam/channel.h"
#include "backend/full_update.h"
#include "backend/local_update.h"
#include "backend/loop_update.h"

namespace hybrid_slam {

// What is found out about a snapshot of the map before the map takes it in.
using MapUpdate = std::variant<LocalUpdate, LoopUpdate, FullUpdate>;

// Runs updates in a thread of its own, one at a time: while it works, keyframes come into the
// map without waiting.
class UpdateWorker {
 public:
  // `done` is called in that thread when an update has been run; it must not wait for the thread.
  explicit UpdateWorker(std::function<void()> done);
  ~UpdateWorker();

  void start(MapUpdate update) { updates_.push(std::move(update)); }

  // Whether the update that was started has been run, or has failed.
  bool is_done() const { return failed_ || results_.size() > 0; }

  // Waits for it. Throws what it threw.
  MapUpdate take();

 private:
  void work();

  std::function<void()> done_;
  Channel<MapUpdate> updates_{1};
  Channel<MapUpdate> results_{1};
  std::exception_ptr failure_;  // before `failed_` is set and results_ closed
  std::atomic<bool> failed_ = false;
  std::jthread thread_;
};

}  // namespace hybrid_slam
