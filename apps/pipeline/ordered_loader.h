#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "apps/pipeline/frame_source.h"

namespace hybrid_slam {

// What became of one index: frames, or the reason why there are none.
struct LoadedFrames {
  std::size_t index = 0;
  std::optional<FrameSet> frames;
  std::string error;
};

// Loads frames ahead of their consumer in several threads and hands them out in order.
class OrderedLoader {
 public:
  // The next index to load; none at the end. Called by one thread at a time; may wait.
  using NextIndex = std::function<std::optional<std::size_t>()>;

  OrderedLoader(const FrameSource& source, int threads, NextIndex next_index);
  ~OrderedLoader();  // stops and joins; whatever next_index waits for must have ended

  OrderedLoader(const OrderedLoader&) = delete;
  OrderedLoader& operator=(const OrderedLoader&) = delete;

  // Waits for the next frame; none after the last. Rethrows what a loader threw beside InputError.
  std::optional<LoadedFrames> next();

  // No further frame is begun; next() delivers what is under way.
  void stop();

  void join();

  // After join().
  const StageTimes& times() const { return times_; }

 private:
  void work();

  const FrameSource& source_;
  NextIndex next_index_;
  const std::size_t window_;  // frames begun and not yet consumed, at most

  std::mutex ticket_mutex_;   // held while an index and its place in the order are drawn
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  std::map<std::size_t, LoadedFrames> ready_;  // by ticket
  std::size_t begun_ = 0;                      // tickets drawn
  std::size_t consumed_ = 0;
  int working_ = 0;  // threads that may still deliver
  bool stopped_ = false;
  std::exception_ptr failure_;
  StageTimes times_;
  std::vector<std::jthread> threads_;  // last: joined before the rest goes
};

// All indices from 0 on, `count` of them.
OrderedLoader::NextIndex indices_below(std::size_t count);

}  // namespace hybrid_slam
