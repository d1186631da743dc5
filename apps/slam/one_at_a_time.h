#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include "frontend/input/image_sequence.h"

namespace hybrid_slam {

// For sequences whose read() is for one thread at a time, which videos' is.
class OneAtATime final : public ImageSequence {
 public:
  explicit OneAtATime(std::unique_ptr<ImageSequence> sequence) : sequence_(std::move(sequence)) {}

  const SequenceInfo& info() const override { return sequence_->info(); }
  FrameImages read(std::size_t frame) const override {
    const std::lock_guard lock(mutex_);
    return sequence_->read(frame);
  }

 private:
  std::unique_ptr<ImageSequence> sequence_;
  mutable std::mutex mutex_;
};

}  // namespace hybrid_slam
