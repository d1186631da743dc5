#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>

#include "apps/slam/channel.h"
#include "apps/slam/mapping_worker.h"

namespace hybrid_slam {

// Bundle adjustment of everything after a loop was closed, of a snapshot, in a thread of its own.
class FullBundleWorker {
 public:
  FullBundleWorker(const FullBundleOptions& options, MappingWorker& mapping);
  ~FullBundleWorker() { finish(true); }

  // A loop was closed: adjust this map, if the options want it. What is being
  // adjusted is completed first; of maps that come meanwhile, the last. Never waits.
  void adjust(std::shared_ptr<const MapSnapshot> map, std::size_t loops_closed);

  // No adjustment begins any more; the present one is completed, or given up.
  void finish(bool give_up);

  // After finish(): the result that mapping no longer took.
  std::optional<FullCorrection> take_correction() {
    return std::exchange(correction_, std::nullopt);
  }

  // After finish().
  const StageTimes& times() const { return times_; }
  const std::string& failure() const { return failure_; }  // a bug of ours; empty if there was none

 private:
  struct Request {
    std::shared_ptr<const MapSnapshot> map;
    std::size_t loops_closed = 0;
  };

  void work();
  bool solve(const Request& request, const std::stop_token& stop);

  FullBundleOptions options_;
  MappingWorker& mapping_;
  Latest<Request> requests_;
  std::mutex mutex_;
  std::stop_source current_;                  // guarded by mutex_
  bool given_up_ = false;                     // guarded by mutex_
  StageTimes times_;                          // the thread's own until finish()
  std::optional<FullCorrection> correction_;  // likewise
  std::string failure_;                       // likewise
  std::jthread thread_;
};

}  // namespace hybrid_slam
