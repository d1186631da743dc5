#include "apps/pipeline/paced_camera.h"

#include <utility>

namespace hybrid_slam {
namespace {

constexpr std::size_t kBacklog = 2;  // images waiting for the pipeline

}  // namespace

PacedCamera::PacedCamera(std::size_t total, double rate, std::stop_token cancelled)
    : indices_(kBacklog),
      thread_([this, total, rate](const std::stop_token& stop) { work(stop, total, rate); }),
      cancel_(std::move(cancelled), [this] { thread_.request_stop(); }) {}

int PacedCamera::finish() {
  thread_.request_stop();
  if (thread_.joinable()) {
    thread_.join();
  }
  return dropped_;
}

void PacedCamera::work(const std::stop_token& stop, std::size_t total, double rate) {
  const auto start = Clock::now();
  for (std::size_t i = 0; i < total; ++i) {
    const std::chrono::duration<double> age(static_cast<double>(i) / rate);
    if (!wait_until(start + std::chrono::duration_cast<Clock::duration>(age), stop)) {
      break;
    }
    dropped_ += indices_.try_push(i) ? 0 : 1;
  }
  indices_.close();
}

// False if no further image shall come.
bool PacedCamera::wait_until(Clock::time_point due, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  wake_.wait_until(lock, stop, due, [] { return false; });
  return !stop.stop_requested();
}

}  // namespace hybrid_slam
