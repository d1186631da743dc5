#include <optional>
#include <utility>

#include "apps/slam/checkpoint_worker.h"
#include "apps/slam/frame_tracking.h"
#include "apps/slam/full_bundle_worker.h"
#include "apps/slam/loop_worker.h"
#include "apps/slam/mapping_worker.h"
#include "apps/slam/slam_core.h"
#include "backend/map/odometry.h"

namespace hybrid_slam {
namespace {

// Tracks in the thread that calls; behind it work mapping, the search for loops, full bundle
// adjustment and checkpoints, each in its own.
class RealtimeCore final : public SlamCore {
 public:
  RealtimeCore(const CoreSetUp& set_up, Map map)
      : observers_(set_up.observers),
        paced_(set_up.session.drop),
        local_mapping_(set_up.options, std::move(map)),
        tracking_(set_up.cameras, set_up.options, set_up.session.vocabulary,
                  set_up.session.localize, local_mapping_, observers_, times_),
        checkpoints_(set_up.checkpoint, set_up.session.checkpoint_every,
                     [this](const SessionFailure& failure) { observers_.failure(failure); }),
        mapping_(local_mapping_, set_up.session.vocabulary, events(), paced_) {
    if (!set_up.options.loops.enabled || set_up.session.localize) return;
    const auto places = std::make_shared<KeyframeDatabase>(set_up.session.vocabulary);
    loop_closing_.emplace(places, set_up.options.loops.finder,
                          [this](const LoopRecord& loop) { observers_.loop(loop); });
    loops_.emplace(*loop_closing_, mapping_, places);
    full_bundle_.emplace(set_up.options.backend.full, mapping_);
  }
  ~RealtimeCore() override { join(true); }

  // Frames that come at their own pace press for time: tracking waits for nobody. Others wait for
  // mapping, so that tracking is never more than one keyframe of each camera ahead.
  void take(CameraFrame frame) override {
    if (!paced_ && frame.camera == CameraKind::kStereo) mapping_.wait_until_taken();
    const auto newest = mapping_.published();
    if (newest != seen_) *tracking_.places() = newest->places;
    seen_ = newest;
    auto job = tracking_.track(std::move(frame), *newest->map, mapping_.has_room());
    if (job) add_keyframe(std::move(*job));
  }

  void finish(bool cancelled) override {
    join(cancelled);
    mapping_.rethrow();
    if (loops_) end_loops(cancelled);
    local_mapping_.conclude(tracking_.end());
    mapping_.publish();
    observers_.map(map(), MapChange::kEnd);
  }

  std::shared_ptr<const MapSnapshot> map() const override { return mapping_.snapshot(); }

  StageTimes times() const override {
    StageTimes all = times_;
    all.merge(mapping_.times());
    if (loops_) {
      all.merge(loops_->times());
      all.merge(full_bundle_->times());
    }
    all.merge(checkpoints_.times());
    return all;
  }

 private:
  // The first one of the map, or of a component, is what there is to track against.
  void add_keyframe(MappingJob job) {
    const auto& odometry = job.keyframe.odometry;
    const bool first = !map()->origin().valid() || (odometry != nullptr && is_loose(*odometry));
    const CameraId camera = job.keyframe.observations->camera;
    const std::int64_t index = job.frame_index();
    std::size_t seen = mapping_.version();
    if (!mapping_.add(std::move(job))) {  // its thread has failed
      mapping_.finish();
      mapping_.rethrow();
    }
    while (first && map()->newest_frame_index(camera) < index && mapping_.wait_for_map(seen)) {
    }
  }

  // Mapping first: the others learn that it takes nothing any more, and it tells them nothing.
  void join(bool give_up) {
    mapping_.finish();
    if (loops_) {
      loops_->finish();
      full_bundle_->finish(give_up);
    }
    checkpoints_.finish();
  }

  MappingEvents events() {
    MappingEvents events;
    events.mapped = [this](const KeyframeResult& keyframe,
                           const std::shared_ptr<const MapSnapshot>& map) {
      observers_.keyframe(keyframe);
      observers_.map(map, MapChange::kKeyframe);
      checkpoints_.keyframe_added(map);
      if (loops_) loops_->keyframe_mapped(keyframe.id);
    };
    events.looped = [this](const LoopOutcome& outcome,
                           const std::shared_ptr<const MapSnapshot>& map,
                           std::size_t loops_closed) {
      loops_->loop_handled(outcome);
      if (outcome.end != LoopEnd::kClosed) return;
      observers_.map(map, MapChange::kLoop);
      full_bundle_->adjust(map, loops_closed);
    };
    events.adjusted = [this](const std::shared_ptr<const MapSnapshot>& map) {
      observers_.map(map, MapChange::kFullBundle);
    };
    return events;
  }

  void end_loops(bool cancelled) {
    for (const std::string& failure : {loops_->failure(), full_bundle_->failure()}) {
      if (!failure.empty()) observers_.failure({failure, true});
    }
    if (!cancelled) close_left_loops();
    loop_closing_->finish();
  }

  // What the threads left, in order; they have ended.
  void close_left_loops() {
    const auto close = [&](const LoopMeasurement& loop) {
      loop_closing_->closed(local_mapping_.close(loop, times_, [] {}));
    };
    if (const auto loop = loops_->take_loop()) close(*loop);
    for (const KeyframeId id : loops_->take_keyframes()) {
      if (const auto loop = loop_closing_->find(*local_mapping_.snapshot(), id, times_)) {
        close(*loop);
      }
    }
    std::size_t adjusted = mapping_.loops_adjusted();
    if (auto correction = full_bundle_->take_correction()) {
      adjusted = correction->loops_closed;
      local_mapping_.take_in_full(std::move(correction->result), adjusted, times_);
    }
    if (local_mapping_.closings() > adjusted) local_mapping_.adjust_full(times_, [] {});
    mapping_.publish();
    observers_.map(map(), MapChange::kFullBundle);
  }

  Observers& observers_;
  bool paced_;
  StageTimes times_;
  LocalMapping local_mapping_;
  FrameTracking tracking_;
  CheckpointWorker checkpoints_;
  std::optional<LoopClosing> loop_closing_;
  MappingWorker mapping_;
  std::shared_ptr<const PublishedMap> seen_;  // by tracking
  std::optional<LoopWorker> loops_;
  std::optional<FullBundleWorker> full_bundle_;
};

}  // namespace

std::unique_ptr<SlamCore> make_realtime_core(const CoreSetUp& set_up, Map map) {
  return std::make_unique<RealtimeCore>(set_up, std::move(map));
}

}  // namespace hybrid_slam
