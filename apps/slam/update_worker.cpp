#include "apps/slam/update_worker.h"

#include <utility>

#include "apps/slam/give_way.h"

namespace hybrid_slam {

UpdateWorker::UpdateWorker(std::function<void()> done)
    : done_(std::move(done)), thread_([this] { work(); }) {}

UpdateWorker::~UpdateWorker() {
  updates_.close();
  results_.close();
}

MapUpdate UpdateWorker::take() {
  auto update = results_.pop();
  if (!update) std::rethrow_exception(failure_);
  return std::move(*update);
}

void UpdateWorker::work() {
  give_way();
  try {
    while (auto update = updates_.pop()) {
      std::visit([](auto& one) { one.run(); }, *update);
      results_.push(std::move(*update));
      done_();
    }
  } catch (...) {
    failure_ = std::current_exception();
    failed_ = true;
    results_.close();
    done_();
  }
}

}  // namespace hybrid_slam
