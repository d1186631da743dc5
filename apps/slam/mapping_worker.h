#pragma once

#include <deque>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "apps/slam/channel.h"
#include "apps/slam/local_mapping.h"
#include "apps/slam/reaper.h"
#include "apps/slam/session_types.h"
#include "apps/slam/update_worker.h"
#include "frontend/place_recognition/keyframe_database.h"

namespace hybrid_slam {

// A bundle adjustment of everything, to be carried over the loops that were closed since its
// snapshot.
struct FullCorrection {
  std::size_t loops_closed = 0;  // when the snapshot was taken
  BundleResult result;
};

// What others learn from the mapping thread, in which they are called: they must not wait.
struct MappingEvents {
  std::function<void(const KeyframeResult&, const std::shared_ptr<const MapSnapshot>&)> mapped;
  // With the map after it, and how many loops are closed now.
  std::function<void(const LoopOutcome&, const std::shared_ptr<const MapSnapshot>&, std::size_t)>
      looped;
  std::function<void(const std::shared_ptr<const MapSnapshot>&)> adjusted;  // all of it
};

// A map and, found once for all who recognise places, the words of its keyframes.
struct PublishedMap {
  std::shared_ptr<const MapSnapshot> map;
  KeyframeDatabase places;
};

// The map's owner in a thread of its own. Keyframes, loops and corrections go in, snapshots come
// out.
class MappingWorker {
 public:
  // `beside`: the map is optimised in another thread, so that a keyframe comes into it at once,
  // whatever that takes; several of them may then be optimised together. Else one by one.
  MappingWorker(LocalMapping& mapping, const Vocabulary& vocabulary, MappingEvents events,
                bool beside);
  ~MappingWorker() { finish(); }

  // Whether a keyframe would not have to wait. From the one thread that adds keyframes.
  bool has_room() const { return tasks_.size() < kKeyframeBacklog; }

  // False, and nothing is done, once this is finished or has failed (see rethrow()).
  bool add(MappingJob job) { return tasks_.push(std::move(job)); }
  bool add(LoopMeasurement loop) { return tasks_.push(std::move(loop)); }
  bool add(FullCorrection correction) { return tasks_.push(std::move(correction)); }

  // Until the worker has begun with the last task it was given.
  void wait_until_taken() { tasks_.wait_empty(); }

  // The newest map, and with it the words of its keyframes.
  std::shared_ptr<const MapSnapshot> snapshot() const { return published()->map; }
  std::shared_ptr<const PublishedMap> published() const { return snapshots_.get(); }

  // Until the map has begun, there is nothing to track against.
  // Waits for the map after version `seen`. False once there will be none any more.
  bool wait_for_map(std::size_t& seen) const { return snapshots_.next(seen) != nullptr; }
  std::size_t version() const { return snapshots_.version(); }

  // What is queued is still done.
  void finish();

  // The map as it is. After finish(), for who went on with it.
  void publish();

  // After finish(): what the thread threw, if it did.
  void rethrow() const;

  // After finish().
  const StageTimes& times() const { return times_; }
  std::size_t loops_adjusted() const { return loops_adjusted_; }  // in the last full adjustment

 private:
  // Keyframes waiting for mapping; and room for a loop and for corrections, so that those who bring
  // them do not keep keyframes out.
  static constexpr std::size_t kKeyframeBacklog = 3;
  static constexpr std::size_t kOthers = 3;

  // An update has been run.
  struct UpdateDone {};
  // What moves the map: it waits until no update works.
  using Move = std::variant<LoopMeasurement, FullCorrection>;

  void work();
  void take(MappingJob& job);
  void take(LoopMeasurement& loop) { moves_.emplace_back(std::move(loop)); }
  void take(FullCorrection& correction) { moves_.emplace_back(std::move(correction)); }
  void take(UpdateDone&);
  void go_on();
  void settle();
  void next_move();
  void run(LoopMeasurement& loop);
  void run(FullCorrection& correction);
  std::vector<KeyframeId> still_there() const;
  void begin(MapUpdate update);
  void end(MapUpdate update);
  void end_update(LocalUpdate update);
  void end_update(LoopUpdate update);
  void end_update(FullUpdate update);

  LocalMapping& mapping_;
  MappingEvents events_;
  Channel<std::variant<MappingJob, LoopMeasurement, FullCorrection, UpdateDone>> tasks_;
  Reaper reaper_;  // of snapshots that nobody holds any more
  KeyframeDatabase places_;
  Latest<PublishedMap> snapshots_;
  // The thread's own until finish():
  StageTimes times_;
  std::size_t loops_adjusted_ = 0;
  std::exception_ptr failure_;
  std::vector<KeyframeResult> inserted_;   // since the last update began
  std::vector<KeyframeResult> in_update_;  // those that the present one optimises
  std::deque<Move> moves_;
  // A loop that is being closed; and, once the map was moved to it, with its outcome.
  std::optional<LoopMeasurement> closing_;
  std::optional<LoopOutcome> closed_;
  bool updating_ = false;  // beside
  std::optional<UpdateWorker> updates_;
  std::jthread thread_;
};

}  // namespace hybrid_slam
