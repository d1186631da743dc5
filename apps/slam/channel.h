#pragma once

#include <condition_variable>
#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

namespace hybrid_slam {

// What lets threads wait for one another until it is closed: the base of the two below.
// Thread-safe.
class Closable {
 public:
  // Ends all waiting, for good. The flag is set under the lock, so that no waiter can miss it.
  void close() {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    changed_.notify_all();
  }

 protected:
  Closable() = default;
  ~Closable() = default;

  // Waits until `condition` holds or all is closed. Returns with the lock held.
  template <typename Condition>
  std::unique_lock<std::mutex> wait_for(const Condition& condition) const {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || condition(); });
    return lock;
  }

  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  bool closed_ = false;  // guarded by mutex_
};

// A bounded queue between two stages. Thread-safe. Shutting down is closing: what is queued is
// still delivered, then pop() comes back empty; no push succeeds any more.
template <typename T>
class Channel : public Closable {
 public:
  explicit Channel(std::size_t capacity) : capacity_(capacity) {}

  // Waits while the channel is full. False, and the value is dropped, once it is closed.
  bool push(T value) {
    const auto lock = wait_for([this] { return queue_.size() < capacity_; });
    return append(std::move(value));
  }

  // Never waits: false if there is no room, or the channel is closed.
  bool try_push(T value) {
    const std::lock_guard lock(mutex_);
    return append(std::move(value));
  }

  // Waits for a value. Empty once the channel is closed and drained.
  std::optional<T> pop() {
    const auto lock = wait_for([this] { return !queue_.empty(); });
    if (queue_.empty()) {
      return std::nullopt;
    }
    std::optional<T> value(std::move(queue_.front()));
    queue_.pop_front();
    changed_.notify_all();
    return value;
  }

  // Waits until nothing is queued, or the channel is closed.
  void wait_empty() const {
    wait_for([this] { return queue_.empty(); });
  }

  std::size_t size() const {
    const std::lock_guard lock(mutex_);
    return queue_.size();
  }

 private:
  // With the lock held.
  bool append(T&& value) {
    if (closed_ || queue_.size() >= capacity_) {
      return false;
    }
    queue_.push_back(std::move(value));
    changed_.notify_all();
    return true;
  }

  const std::size_t capacity_;
  std::deque<T> queue_;  // guarded by mutex_
};

// The newest value of something that is published again and again; readers keep what they took.
// Thread-safe.
template <typename T>
class Latest : public Closable {
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

  // Waits for a publication after version `seen` (0: for any), which becomes that of the value
  // returned. Null once it is closed.
  std::shared_ptr<const T> next(std::size_t& seen) const {
    const auto lock = wait_for([&] { return version_ > seen; });
    if (closed_) {
      return nullptr;
    }
    seen = version_;
    return value_;
  }

  std::size_t version() const {
    const std::lock_guard lock(mutex_);
    return version_;
  }

 private:
  std::shared_ptr<const T> value_;  // guarded by mutex_
  std::size_t version_ = 0;         // guarded by mutex_
};

}  // namespace hybrid_slam
