#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

namespace hybrid_slam {

// A bounded queue between two stages. Thread-safe. Shutting down is closing: what is queued is
// still delivered, then pop() comes back empty.
template <typename T>
class Channel {
 public:
  explicit Channel(std::size_t capacity) : capacity_(capacity) {}

  // Waits while the channel is full. False, and the value is dropped, once it is closed.
  bool push(T value) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || queue_.size() < capacity_; });
    if (closed_) {
      return false;
    }
    queue_.push_back(std::move(value));
    changed_.notify_all();
    return true;
  }

  // Never waits: false if there is no room, or the channel is closed.
  bool try_push(T value) {
    const std::lock_guard lock(mutex_);
    if (closed_ || queue_.size() >= capacity_) {
      return false;
    }
    queue_.push_back(std::move(value));
    changed_.notify_all();
    return true;
  }

  // Waits for a value. Empty once the channel is closed and drained.
  std::optional<T> pop() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || !queue_.empty(); });
    if (queue_.empty()) {
      return std::nullopt;
    }
    std::optional<T> value(std::move(queue_.front()));
    queue_.pop_front();
    changed_.notify_all();
    return value;
  }

  // Waits until nothing is queued, or the channel is closed.
  void wait_empty() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return closed_ || queue_.empty(); });
  }

  std::size_t size() const {
    const std::lock_guard lock(mutex_);
    return queue_.size();
  }

  // No push succeeds any more. The flag is set under the lock, so that no waiter can miss it.
  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

 private:
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<T> queue_;  // guarded by mutex_
  bool closed_ = false;  // guarded by mutex_
};

// The newest value of something that is published again and again; readers keep what they took.
// Thread-safe.
template <typename T>
class Latest {
 public:
  void publish(std::shared_ptr<const T> value) {
    const std::lock_guard lock(mutex_);
    value_ = std::move(value);
    ++version_;
    changed_.notify_all();
  }

  // Null before the first publication.
  std::shared_ptr<const T> get() const {
    const std::lock_guard lock(mutex_);
    return value_;
  }

  // Waits for a publication after version `seen` (see version()), or close().
  void wait_beyond(std::size_t seen) const {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || version_ > seen; });
  }

  std::size_t version() const {
    const std::lock_guard lock(mutex_);
    return version_;
  }

  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

 private:
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::shared_ptr<const T> value_;  // guarded by mutex_
  std::size_t version_ = 0;         // guarded by mutex_
  bool closed_ = false;             // guarded by mutex_
};

}  // namespace hybrid_slam
