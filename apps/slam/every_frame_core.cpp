#include <optional>
#include <utility>

#include "apps/slam/channel.h"
#include "apps/slam/checkpoint_worker.h"
#include "apps/slam/frame_tracking.h"
#include "apps/slam/slam_core.h"

namespace hybrid_slam {
namespace {

// Everything in the thread that calls.
class EveryFrameCore final : public SlamCore {
 public:
  EveryFrameCore(const CoreSetUp& set_up, Map map)
      : observers_(set_up.observers),
        checkpoint_(set_up.checkpoint),
        checkpoints_(set_up.session.checkpoint_every),
        mapping_(set_up.options, std::move(map)),
        tracking_(set_up.cameras, set_up.options, set_up.session.vocabulary,
                  set_up.session.localize, mapping_, observers_, times_) {
    if (set_up.options.loops.enabled && !set_up.session.localize) {
      loops_.emplace(tracking_.places(), set_up.options.loops.finder,
                     [this](const LoopRecord& loop) { observers_.loop(loop); });
    }
    publish();
  }

  void take(CameraFrame frame) override {
    const auto job = tracking_.track(std::move(frame), *map());
    if (!job) return;
    const KeyframeId id = mapping_.process(*job, times_, [this] { publish(); });
    observers_.keyframe({job->camera, job->frame_index(), id});
    observers_.map(map(), MapChange::kKeyframe);
    close_loop(id);
    if (checkpoints_.due()) save();
  }

  void finish(bool) override {
    mapping_.conclude(tracking_.end());
    publish();
    observers_.map(map(), MapChange::kEnd);
  }

  std::shared_ptr<const MapSnapshot> map() const override { return snapshots_.get(); }
  StageTimes times() const override { return times_; }

 private:
  void publish() { snapshots_.publish(mapping_.snapshot()); }

  void close_loop(KeyframeId id) {
    const auto loop = loops_ ? loops_->find(*map(), id, times_) : std::nullopt;
    if (!loop) return;
    const LoopOutcome outcome = mapping_.close(*loop, times_, [this] { publish(); });
    loops_->closed(outcome);
    if (outcome.end != LoopEnd::kClosed) return;
    observers_.map(map(), MapChange::kLoop);
    mapping_.adjust_full(times_, [this] {
      publish();
      observers_.map(map(), MapChange::kFullBundle);
    });
  }

  void save() {
    if (auto failure = save_checkpoint(checkpoint_, *map(), times_)) {
      observers_.failure(std::move(*failure));
    }
  }

  Observers& observers_;
  SaveCheckpoint checkpoint_;
  CheckpointSchedule checkpoints_;
  StageTimes times_;
  Latest<MapSnapshot> snapshots_;
  LocalMapping mapping_;
  FrameTracking tracking_;
  std::optional<LoopClosing> loops_;
};

}  // namespace

std::unique_ptr<SlamCore> make_every_frame_core(const CoreSetUp& set_up, Map map) {
  return std::make_unique<EveryFrameCore>(set_up, std::move(map));
}

}  // namespace hybrid_slam
