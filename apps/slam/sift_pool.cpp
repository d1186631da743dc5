#include "apps/slam/sift_pool.h"

#include <utility>

namespace hybrid_slam {

SiftPool::SiftPool(SiftDevice device, const SiftOptions& options, int images, int limit)
    : device_(device), options_(options), images_(images), limit_(limit) {}

SiftPool::Lease SiftPool::take() {
  return {idle_or_new().release(),
          [this](SiftBatch* sift) { give_back(std::unique_ptr<SiftBatch>(sift)); }};
}

int SiftPool::made() const {
  const std::lock_guard lock(mutex_);
  return made_;
}

std::unique_ptr<SiftBatch> SiftPool::idle_or_new() {
  {
    std::unique_lock lock(mutex_);
    returned_.wait(lock, [this] { return !idle_.empty() || made_ < limit_; });
    if (!idle_.empty()) {
      std::unique_ptr<SiftBatch> sift = std::move(idle_.back());
      idle_.pop_back();
      return sift;
    }
    ++made_;
    idle_.reserve(static_cast<std::size_t>(made_));  // so that give_back() cannot fail
  }
  try {
    return std::make_unique<SiftBatch>(device_, options_, images_);
  } catch (...) {
    const std::lock_guard lock(mutex_);
    --made_;
    returned_.notify_one();
    throw;
  }
}

void SiftPool::give_back(std::unique_ptr<SiftBatch> sift) {
  const std::lock_guard lock(mutex_);
  idle_.push_back(std::move(sift));
  returned_.notify_one();
}

}  // namespace hybrid_slam
