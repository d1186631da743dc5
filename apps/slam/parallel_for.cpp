#include "apps/slam/parallel_for.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

namespace hybrid_slam {
namespace {

// Deals out what is to be done, and remembers the failure of the lowest number.
class WorkList {
 public:
  explicit WorkList(std::size_t count) : count_(count) {}

  std::optional<std::size_t> next() {
    const std::lock_guard lock(mutex_);
    if (failure_ || next_ == count_) return std::nullopt;
    return next_++;
  }

  void failed(std::size_t i, std::exception_ptr failure) {
    const std::lock_guard lock(mutex_);
    if (failure_ && failed_ < i) return;
    failed_ = i;
    failure_ = std::move(failure);
  }

  // When all have ended.
  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  const std::size_t count_;
  std::mutex mutex_;
  std::size_t next_ = 0;        // guarded by mutex_
  std::size_t failed_ = 0;      // guarded by mutex_
  std::exception_ptr failure_;  // guarded by mutex_
};

}  // namespace

int default_thread_count() {
  return static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

void parallel_for(std::size_t count, int threads,
                  const std::function<void(std::size_t i, std::size_t worker)>& work) {
  WorkList list(count);
  const auto run = [&](std::size_t worker) {
    while (const auto i = list.next()) {
      try {
        work(*i, worker);
      } catch (...) {
        list.failed(*i, std::current_exception());
      }
    }
  };
  {
    std::vector<std::jthread> others;
    const auto workers = std::min(count, static_cast<std::size_t>(std::max(threads, 1)));
    for (std::size_t worker = 1; worker < workers; ++worker) others.emplace_back(run, worker);
    run(0);
  }
  list.rethrow();
}

}  // namespace hybrid_slam
