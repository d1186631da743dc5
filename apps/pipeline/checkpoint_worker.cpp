#include "apps/pipeline/checkpoint_worker.h"

#include <utility>

namespace hybrid_slam {

CheckpointWorker::CheckpointWorker(std::function<std::string(const MapSnapshot&)> save, int every)
    : save_(std::move(save)),
      every_(every),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

void CheckpointWorker::keyframe_added(std::shared_ptr<const MapSnapshot> map) {
  ++keyframes_;
  if (every_ > 0 && keyframes_ % every_ == 0) {
    maps_.publish(std::move(map));
  }
}

std::vector<std::string> CheckpointWorker::take_failures() {
  const std::lock_guard lock(mutex_);
  return std::exchange(failures_, {});
}

void CheckpointWorker::finish() {
  thread_.request_stop();
  maps_.close();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void CheckpointWorker::rethrow() const {
  if (thrown_) {
    std::rethrow_exception(thrown_);
  }
}

void CheckpointWorker::work(const std::stop_token& stop) {
  std::size_t seen = 0;
  try {
    for (;;) {
      maps_.wait_beyond(seen);
      if (stop.stop_requested()) {
        return;
      }
      seen = maps_.version();
      StageClock clock(times_);
      const std::string failure = save_(*maps_.get());
      clock.lap("checkpoint");
      if (!failure.empty()) {
        const std::lock_guard lock(mutex_);
        failures_.push_back(failure);
      }
    }
  } catch (...) {
    thrown_ = std::current_exception();
  }
}

}  // namespace hybrid_slam
