#include "apps/slam/mapping_worker.h"

#include <utility>

#include "apps/slam/give_way.h"

namespace hybrid_slam {

MappingWorker::MappingWorker(LocalMapping& mapping, const Vocabulary& vocabulary,
                             MappingEvents events, bool beside)
    : mapping_(mapping),
      events_(std::move(events)),
      tasks_(kKeyframeBacklog + kOthers),
      places_(vocabulary) {
  publish();
  if (beside) updates_.emplace([this] { tasks_.push(UpdateDone{}); });
  thread_ = std::jthread([this] { work(); });
}

void MappingWorker::publish() {
  auto map = reaper_.adopt(mapping_.snapshot());
  places_.follow(*map);
  snapshots_.publish(
      reaper_.adopt(std::make_shared<const PublishedMap>(PublishedMap{std::move(map), places_})));
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
      std::visit([this](auto& one) { take(one); }, *task);
      go_on();
    }
    while (updating_) {  // nothing new comes; what did is brought to its end
      end(updates_->take());
      go_on();
    }
  } catch (...) {
    failure_ = std::current_exception();
    tasks_.close();
    while (tasks_.pop()) {  // so that has_room(), and who adds the next keyframe learns of it
    }
  }
  snapshots_.close();
}

void MappingWorker::take(MappingJob& job) {
  if (mapping_.moves_the_map(job)) settle();
  const KeyframeId id = mapping_.insert(job, times_);
  publish();
  inserted_.push_back({job.camera, job.frame_index(), id});
}

void MappingWorker::take(UpdateDone&) {
  if (updating_ && updates_->is_done()) end(updates_->take());
}

// While no update works: what moves the map first, then what was added is optimised.
void MappingWorker::go_on() {
  while (!updating_ && (!moves_.empty() || !inserted_.empty())) {
    if (!moves_.empty()) {
      next_move();
    } else {
      in_update_ = std::exchange(inserted_, {});
      begin(mapping_.begin_update(still_there()));
    }
  }
}

// What was measured in the map as it is comes to its end before that changes size.
void MappingWorker::settle() {
  while (updating_ || !moves_.empty()) {
    if (updating_) {
      end(updates_->take());
    } else {
      next_move();
    }
  }
}

void MappingWorker::next_move() {
  Move move = std::move(moves_.front());
  moves_.pop_front();
  std::visit([this](auto& one) { run(one); }, move);
}

// Of those that were added; if all were culled meanwhile, the map's newest one.
std::vector<KeyframeId> MappingWorker::still_there() const {
  const MapSnapshot& map = mapping_.map().view();
  std::vector<KeyframeId> ids;
  for (const KeyframeResult& one : in_update_) {
    if (map.find(one.id) != nullptr) ids.push_back(one.id);
  }
  if (ids.empty()) ids.push_back(map.keyframe_ids().back());
  return ids;
}

void MappingWorker::run(LoopMeasurement& loop) {
  LoopUpdate update = mapping_.begin_close(loop);
  closing_ = std::move(loop);
  begin(std::move(update));
}

void MappingWorker::run(FullCorrection& correction) {
  loops_adjusted_ = correction.loops_closed;
  begin(mapping_.begin_full(std::move(correction.result), correction.loops_closed));
}

void MappingWorker::begin(MapUpdate update) {
  if (updates_) {
    updating_ = true;
    updates_->start(std::move(update));
  } else {
    std::visit([](auto& one) { one.run(); }, update);
    end(std::move(update));
  }
}

void MappingWorker::end(MapUpdate update) {
  updating_ = false;
  std::visit([this](auto& one) { end_update(std::move(one)); }, update);
}

void MappingWorker::end_update(LocalUpdate update) {
  const std::vector<KeyframeResult> added = std::exchange(in_update_, {});
  std::vector<KeyframeId> ids;
  ids.reserve(added.size());
  for (const KeyframeResult& keyframe : added) ids.push_back(keyframe.id);
  mapping_.end_update(std::move(update), ids, times_);
  const auto closed = std::exchange(closed_, std::nullopt);
  if (closed) mapping_.fuse_sides(*std::exchange(closing_, std::nullopt), times_);
  publish();
  if (closed) events_.looped(*closed, snapshot(), mapping_.closings());
  for (const KeyframeResult& keyframe : added) events_.mapped(keyframe, snapshot());
}

// The map as it was moved is optimised around the loop next.
void MappingWorker::end_update(LoopUpdate update) {
  const LoopOutcome outcome = mapping_.end_close(std::move(update), times_);
  if (outcome.end != LoopEnd::kClosed) {
    closing_.reset();
    events_.looped(outcome, snapshot(), mapping_.closings());
    return;
  }
  publish();
  closed_ = outcome;
  const KeyframeId newest = closing_->keyframe;
  begin(mapping_.begin_update({&newest, 1}));
}

void MappingWorker::end_update(FullUpdate update) {
  mapping_.end_full(std::move(update), times_);
  publish();
  events_.adjusted(snapshot());
}

}  // namespace hybrid_slam
