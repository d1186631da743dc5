#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "apps/slam/frame_extractor.h"
#include "apps/slam/reorder_buffer.h"

namespace hybrid_slam {

struct FrameStreamOptions {
  ReorderOptions reorder;
  int threads = 1;  // that extract features; no result depends on it
  // Whether who pushes faster than frames are taken loses the oldest that waits; else they wait.
  bool drop = false;
  SiftDevice device = SiftDevice::kCpu;
  std::optional<PairAlignment> known_alignment{};  // see FrameExtractor
};

// How many inputs there were, of one camera.
struct StreamCounts {
  std::int64_t taken = 0;
  std::int64_t late = 0;
  std::int64_t duplicate = 0;
  std::int64_t refused = 0;  // of a wrong size, or of a camera that is not there
  std::int64_t dropped = 0;  // taken, but older than others when there was time for them
};

// What came of the inputs next: a frame, inputs that were left out meanwhile, or both.
struct StreamItem {
  std::optional<CameraFrame> frame;
  std::vector<LeftOut> left_out;
};

// Turns what is pushed, by any thread and in any order within the window, into frames in the order
// of their times. Features are extracted in threads of its own.
class FrameStream {
 public:
  FrameStream(const CameraRig& cameras, const SlamOptions& options,
              const FrameStreamOptions& stream);
  ~FrameStream();  // as cancel()

  // Waits for room, unless frames are dropped.
  PushResult push(SensorInput input);

  // Waits for the next frame, or for an input that is left out; none after the last, once this is
  // closed or cancelled. Rethrows what an extracting thread threw. One thread.
  std::optional<StreamItem> next();

  // Who took a frame from next() is done with it.
  void done();

  // Everything pushed up to now is released, as if its window were over.
  void flush();

  // No more is taken; next() still delivers what is here.
  void close();

  // Ends all waiting; next() delivers nothing any more. From any thread.
  void cancel();

  StreamCounts counts(CameraKind camera) const;
  std::size_t waiting() const;  // pushed and not yet done()

  // Joins the extracting threads, after close() or cancel(): what they took.
  StageTimes times();

  // Once the first images have settled it.
  std::optional<UpsamplingEvidence> upsampling() const;
  bool upsamples() const;

 private:
  using Clock = ReorderBuffer::Clock;
  using Lock = std::unique_lock<std::mutex>;
  using Image = std::variant<std::shared_ptr<const StereoImages>,
                             std::shared_ptr<const FisheyeImage>, ExtractedFrame>;
  struct Released {
    CameraKind camera = CameraKind::kStereo;
    Nanoseconds time = 0;
    std::int64_t moment = 0;  // counts different times
    bool first = false;       // before there was an extractor: not dropped
    Image image;
  };

  void work();
  std::optional<Released> take(Lock& lock);
  void make_extractor(Lock& lock);
  CameraFrame extract(Released input, StageTimes& times);
  PushResult check(const SensorInput& input) const;
  void release(bool flush);
  void append(SensorInput input);
  void drop_oldest(CameraKind camera);
  void leave_out(CameraKind camera, Nanoseconds time, const char* reason);
  bool can_begin() const;
  bool is_over() const;
  std::size_t in_flight() const { return released_.size() + (begun_ - consumed_); }
  StreamCounts& counts_of(CameraKind camera) { return counts_[static_cast<int>(camera)]; }

  const CameraRig cameras_;
  const SlamOptions options_;
  const FrameStreamOptions stream_;
  const std::size_t window_;  // frames being extracted, or waiting to be given out, at most

  mutable std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  ReorderBuffer buffer_;
  std::deque<Released> released_;               // in order, to be extracted
  std::map<std::uint64_t, CameraFrame> ready_;  // extracted, by ticket
  FirstImages first_;                           // of those released, until there is an extractor
  std::size_t begun_ = 0;                       // tickets drawn
  std::size_t consumed_ = 0;
  std::size_t given_ = 0;  // and not yet done()
  std::int64_t moment_ = -1;
  Nanoseconds moment_time_ = 0;
  StreamCounts counts_[2];         // by CameraKind
  std::vector<LeftOut> left_out_;  // and not yet told
  StageTimes times_;
  bool settle_now_ = false;  // with the first images that are here
  bool closed_ = false;
  bool cancelled_ = false;
  bool starting_ = false;   // a thread makes the extractor
  bool caught_up_ = false;  // with what came while the first images settled how to extract
  std::exception_ptr failure_;
  std::unique_ptr<FrameExtractor> extractor_;  // does not change once it is there
  std::vector<std::jthread> threads_;          // last: joined before the rest goes
};

}  // namespace hybrid_slam
