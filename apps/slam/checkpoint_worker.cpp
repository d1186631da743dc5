#include "apps/slam/checkpoint_worker.h"

#include <exception>
#include <utility>

#include "apps/slam/give_way.h"

namespace hybrid_slam {

std::optional<SessionFailure> save_checkpoint(const SaveCheckpoint& save, const MapSnapshot& map,
                                              StageTimes& times) {
  StageClock clock(times);
  SessionFailure failure;
  try {
    failure.text = save(map);
  } catch (const std::exception& error) {
    failure = {std::string("internal error while saving a checkpoint: ") + error.what(), true};
  }
  clock.lap("checkpoint");
  return failure.text.empty() ? std::nullopt : std::optional(std::move(failure));
}

CheckpointWorker::CheckpointWorker(SaveCheckpoint save, int every,
                                   std::function<void(const SessionFailure&)> tell)
    : save_(std::move(save)),
      schedule_(every),
      tell_(std::move(tell)),
      thread_([this] { work(); }) {}

void CheckpointWorker::keyframe_added(std::shared_ptr<const MapSnapshot> map) {
  if (schedule_.due()) {
    maps_.publish(std::move(map));
  }
}

void CheckpointWorker::finish() {
  maps_.close();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void CheckpointWorker::work() {
  give_way();
  std::size_t seen = 0;
  while (const auto map = maps_.next(seen)) {
    if (const auto failure = save_checkpoint(save_, *map, times_)) tell_(*failure);
  }
}

}  // namespace hybrid_slam
