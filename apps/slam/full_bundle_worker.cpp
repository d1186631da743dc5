#include "apps/slam/full_bundle_worker.h"

#include <exception>

#include "apps/slam/give_way.h"

namespace hybrid_slam {

FullBundleWorker::FullBundleWorker(const FullBundleOptions& options, MappingWorker& mapping)
    : options_(options), mapping_(mapping), thread_([this] { work(); }) {}

void FullBundleWorker::adjust(std::shared_ptr<const MapSnapshot> map, std::size_t loops_closed) {
  if (!options_.enabled) {
    return;
  }
  requests_.publish(std::make_shared<const Request>(Request{std::move(map), loops_closed}));
}

void FullBundleWorker::finish(bool give_up) {
  requests_.close();
  if (give_up) {
    const std::lock_guard lock(mutex_);
    given_up_ = true;
    current_.request_stop();
  }
  if (thread_.joinable()) {
    thread_.join();
  }
}

void FullBundleWorker::work() {
  give_way();
  try {
    std::size_t seen = 0;
    while (const auto request = requests_.next(seen)) {
      std::stop_source stop;
      {
        const std::lock_guard lock(mutex_);
        if (given_up_) {
          break;
        }
        current_ = stop;
      }
      if (!solve(*request, stop.get_token())) {
        break;
      }
    }
  } catch (const std::exception& error) {
    failure_ = std::string("internal error in the full bundle adjustment: ") + error.what();
  }
}

// False if nobody takes the result.
bool FullBundleWorker::solve(const Request& request, const std::stop_token& stop) {
  StageClock clock(times_);
  FullCorrection correction{request.loops_closed, solve_full(*request.map, options_, stop)};
  clock.lap("full_bundle");
  if (stop.stop_requested()) {
    return true;
  }
  correction_ = std::move(correction);
  if (!mapping_.add(*correction_)) {
    return false;
  }
  correction_.reset();
  return true;
}

}  // namespace hybrid_slam
