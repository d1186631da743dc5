#include "apps/slam/loop_worker.h"

#include <exception>
#include <utility>

#include "apps/slam/give_way.h"

namespace hybrid_slam {

LoopWorker::LoopWorker(LoopClosing& closing, MappingWorker& mapping,
                       std::shared_ptr<KeyframeDatabase> places)
    : closing_(closing),
      mapping_(mapping),
      places_(std::move(places)),
      keyframes_(kBacklog),
      outcomes_(1),
      thread_([this] { work(); }) {}

void LoopWorker::finish() {
  stop_.request_stop();
  keyframes_.close();
  outcomes_.close();
  if (thread_.joinable()) {
    thread_.join();
  }
}

std::vector<KeyframeId> LoopWorker::take_keyframes() {
  std::vector<KeyframeId> left;
  while (auto id = keyframes_.pop()) {
    left.push_back(*id);
  }
  return left;
}

void LoopWorker::work() {
  give_way();
  try {
    while (!stop_.stop_requested()) {
      const auto id = keyframes_.pop();
      if (!id || !look_at(*id)) {
        break;
      }
    }
  } catch (const std::exception& error) {
    failure_ = std::string("internal error while looking for loops: ") + error.what();
    keyframes_.close();
  }
}

// False if nobody closes loops any more.
bool LoopWorker::look_at(KeyframeId id) {
  const auto newest = mapping_.published();
  *places_ = newest->places;
  loop_ = closing_.find(*newest->map, id, times_);
  if (!loop_) {
    return true;
  }
  if (!mapping_.add(*loop_)) {
    return false;
  }
  const auto outcome = outcomes_.pop();
  if (!outcome) {
    return false;
  }
  loop_.reset();
  closing_.closed(*outcome);
  return true;
}

}  // namespace hybrid_slam
