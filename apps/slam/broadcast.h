#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "apps/slam/channel.h"

namespace hybrid_slam {

// Texts for any number of readers, each at a place of its own. Only the newest are kept, up to a
// number of bytes for all readers together: nobody waits for a reader, and one that is too slow is
// told that it has missed something. Thread-safe.
class Broadcast : public Closable {
 public:
  using Text = std::shared_ptr<const std::string>;

  explicit Broadcast(std::size_t bytes) : capacity_(bytes) {}

  // The newest one is kept, however large it is. Nothing is taken once this is closed.
  void publish(Text text) {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    bytes_ += text->size();
    texts_.push_back(std::move(text));
    while (bytes_ > capacity_ && texts_.size() > 1) {
      bytes_ -= texts_.front()->size();
      texts_.pop_front();
      ++first_;
    }
    changed_.notify_all();
  }

  // The place after the newest text.
  std::uint64_t end() const {
    const std::lock_guard lock(mutex_);
    return first_ + texts_.size();
  }

  enum class What {
    kText,
    kNothing,  // has come within the time
    kMissed,   // what stood at this place is gone
    kOver      // this is closed, and all has been read
  };
  struct Next {
    What what = What::kNothing;
    Text text{};
  };

  // What stands at `place`, which goes on to the next; waits for it so long at most.
  Next next(std::uint64_t& place, std::chrono::milliseconds patience) const {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, patience, [&] { return closed_ || place < first_ + texts_.size(); });
    if (place < first_) return {What::kMissed};
    if (place >= first_ + texts_.size()) return {closed_ ? What::kOver : What::kNothing};
    return {What::kText, texts_[static_cast<std::size_t>(place++ - first_)]};
  }

 private:
  const std::size_t capacity_;
  std::deque<Text> texts_;   // guarded by mutex_, as all below
  std::uint64_t first_ = 0;  // the place of the oldest text
  std::size_t bytes_ = 0;
};

}  // namespace hybrid_slam
