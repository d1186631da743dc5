#pragma once

#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "apps/slam/channel.h"
#include "apps/slam/loop_closing.h"
#include "apps/slam/mapping_worker.h"

namespace hybrid_slam {

// Looks for the loops of new keyframes in a thread of its own, in the newest map, and hands them to
// mapping, one at a time.
class LoopWorker {
 public:
  // `places`: those that `closing` looks into; they get the words that mapping has found.
  LoopWorker(LoopClosing& closing, MappingWorker& mapping,
             std::shared_ptr<KeyframeDatabase> places);
  ~LoopWorker() { finish(); }

  // A keyframe is in the map. Never waits: where too many wait already, its loops are not looked
  // for.
  void keyframe_mapped(KeyframeId id) { keyframes_.try_push(id); }

  // What became of the loop that was handed over. Never waits.
  void loop_handled(const LoopOutcome& outcome) { outcomes_.try_push(outcome); }

  // Ends the search; what is under way is completed.
  void finish();

  // After finish(): the loop that mapping no longer took, and the keyframes that nobody looked at.
  std::optional<LoopMeasurement> take_loop() { return std::exchange(loop_, std::nullopt); }
  std::vector<KeyframeId> take_keyframes();

  // After finish().
  const StageTimes& times() const { return times_; }
  const std::string& failure() const { return failure_; }  // a bug of ours; empty if there was none

 private:
  static constexpr std::size_t kBacklog = 32;

  void work();
  bool look_at(KeyframeId id);

  LoopClosing& closing_;
  MappingWorker& mapping_;
  std::shared_ptr<KeyframeDatabase> places_;  // the thread's own until finish()
  Channel<KeyframeId> keyframes_;
  Channel<LoopOutcome> outcomes_;
  StageTimes times_;                     // the thread's own until finish()
  std::optional<LoopMeasurement> loop_;  // likewise
  std::string failure_;                  // likewise
  std::stop_source stop_;
  std::jthread thread_;
};

}  // namespace hybrid_slam
