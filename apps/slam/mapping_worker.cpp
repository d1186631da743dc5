#include "apps/slam/mapping_worker.h"

#include <utility>

#include "apps/slam/give_way.h"

namespace hybrid_slam {

MappingWorker::MappingWorker(LocalMapping& mapping, const Vocabulary& vocabulary,
                             MappingEvents events)
    : mapping_(mapping),
      events_(std::move(events)),
      tasks_(kKeyframeBacklog + kOthers),
      places_(vocabulary) {
  publish();
  thread_ = std::jthread([this] { work(); });
}

void MappingWorker::publish() {
  auto map = reaper_.adopt(mapping_.snapshot());
  places_.follow(*map);
  snapshots_.publish(reaper_.adopt(std::make_shared<const PublishedMap>(std::move(map), places_)));
}

void MappingWorker::hurry() {
  const std::lock_guard lock(mutex_);
  current_.request_stop();
}

void MappingWorker::finish() {
  tasks_.close();
  if (thread_.joinable()) {
    thread_.join();
  }
}

void MappingWorker::rethrow() const {
  if (failure_) {
    std::rethrow_exception(failure_);
  }
}

void MappingWorker::work() {
  give_way();
  try {
    while (auto task = tasks_.pop()) {
      std::visit([this](auto& one) { run(one); }, *task);
    }
  } catch (...) {
    failure_ = std::current_exception();
    tasks_.close();
  }
  snapshots_.close();
}

void MappingWorker::run(MappingJob& job) {
  std::stop_source stop;
  {
    const std::lock_guard lock(mutex_);
    current_ = stop;
  }
  const KeyframeId id = mapping_.process(job, times_, stop.get_token(), [this] { publish(); });
  events_.mapped({job.camera, job.frame_index(), id}, snapshot());
}

void MappingWorker::run(LoopMeasurement& loop) {
  const LoopOutcome outcome = mapping_.close(loop, times_, [this] { publish(); });
  events_.looped(outcome, snapshot(), mapping_.closings());
}

void MappingWorker::run(FullCorrection& correction) {
  mapping_.take_in_full(std::move(correction.result), correction.loops_closed, times_,
                        [this] { publish(); });
  loops_adjusted_ = correction.loops_closed;
  events_.adjusted(snapshot());
}

}  // namespace hybrid_slam
