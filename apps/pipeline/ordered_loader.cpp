#include "apps/pipeline/ordered_loader.h"

#include <algorithm>
#include <utility>

#include "cameras/input_error.h"

namespace hybrid_slam {

OrderedLoader::OrderedLoader(const FrameSource& source, int threads, NextIndex next_index)
    : source_(source),
      next_index_(std::move(next_index)),
      window_(static_cast<std::size_t>(std::max(threads, 1)) + 1),
      working_(std::max(threads, 1)) {
  const int count = working_;
  for (int i = 0; i < count; ++i) {
    threads_.emplace_back([this] { work(); });
  }
}

OrderedLoader::~OrderedLoader() { stop(); }

void OrderedLoader::stop() {
  const std::lock_guard lock(mutex_);
  stopped_ = true;
  changed_.notify_all();
}

void OrderedLoader::join() { threads_.clear(); }

void OrderedLoader::work() {
  StageTimes times;
  try {
    const auto loader = source_.make_loader();
    while (true) {
      std::unique_lock ticket_lock(ticket_mutex_);
      {
        std::unique_lock lock(mutex_);
        changed_.wait(lock, [this] { return stopped_ || begun_ - consumed_ < window_; });
        if (stopped_) {
          break;
        }
      }
      const auto index = next_index_();
      if (!index) {
        break;
      }
      std::size_t ticket = 0;
      {
        const std::lock_guard lock(mutex_);
        ticket = begun_++;
      }
      ticket_lock.unlock();
      LoadedFrames loaded{*index, std::nullopt, {}};
      try {
        loaded.frames = loader->load(*index, times);
      } catch (const InputError& error) {
        loaded.error = error.what();
      }
      const std::lock_guard lock(mutex_);
      ready_.emplace(ticket, std::move(loaded));
      changed_.notify_all();
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
    stopped_ = true;
  }
  const std::lock_guard lock(mutex_);
  times_.merge(times);
  --working_;
  changed_.notify_all();
}

std::optional<LoadedFrames> OrderedLoader::next() {
  std::unique_lock lock(mutex_);
  changed_.wait(
      lock, [this] { return failure_ != nullptr || ready_.contains(consumed_) || working_ == 0; });
  if (failure_ != nullptr) {
    std::rethrow_exception(failure_);
  }
  const auto at = ready_.find(consumed_);
  if (at == ready_.end()) {
    return std::nullopt;
  }
  LoadedFrames loaded = std::move(at->second);
  ready_.erase(at);
  ++consumed_;
  changed_.notify_all();
  return loaded;
}

OrderedLoader::NextIndex indices_below(std::size_t count) {
  return [next = std::size_t{0}, count]() mutable {
    return next < count ? std::optional(next++) : std::nullopt;
  };
}

}  // namespace hybrid_slam
