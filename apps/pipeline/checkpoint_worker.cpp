#include "apps/pipeline/checkpoint_worker.h"

#include <exception>
#include <utility>

namespace hybrid_slam {

std::optional<RunFailure> save_checkpoint(const SaveMap& save, const MapSnapshot& map,
                                          StageTimes& times) {
  StageClock clock(times);
  RunFailure failure;
  try {
    failure.text = save(map);
  } catch (const std::exception& error) {
    failure = {std::string("internal error while saving a checkpoint: ") + error.what(), true};
  }
  clock.lap("checkpoint");
  return failure.text.empty() ? std::nullopt : std::optional(std::move(failure));
}

CheckpointWorker::CheckpointWorker(SaveMap save, int every)
    : save_(std::move(save)), schedule_(every), thread_([this] { work(); }) {}

void CheckpointWorker::keyframe_added(std::shared_ptr<const MapSnapshot> map) {
  if (schedule_.due()) {
    maps_.publish(std::move(map));
  }
}

std::vector<RunFailure> CheckpointWorker::take_failures() {
  const std::lock_guard lock(mutex_);
  return std::exchange(failures_, {});
}

void CheckpointWorker::finish() {
  maps_.close();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void CheckpointWorker::work() {
  std::size_t seen = 0;
  while (const auto map = maps_.next(seen)) {
    auto failure = save_checkpoint(save_, *map, times_);
    if (failure) {
      const std::lock_guard lock(mutex_);
      failures_.push_back(std::move(*failure));
    }
  }
}

}  // namespace hybrid_slam
