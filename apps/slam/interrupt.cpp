#include "apps/slam/interrupt.h"

#include <condition_variable>
#include <csignal>
#include <mutex>

namespace hybrid_slam {
namespace {

constexpr int kFinished = SIGUSR1;  // from the destructor to the thread

sigset_t interrupts() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  return set;
}

sigset_t awaited() {
  sigset_t set = interrupts();
  sigaddset(&set, kFinished);
  return set;
}

}  // namespace

Interrupt::Interrupt() {
  const sigset_t set = awaited();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  thread_ = std::jthread([this](const std::stop_token& finished) { wait(finished); });
}

Interrupt::~Interrupt() {
  thread_.request_stop();
  pthread_kill(thread_.native_handle(), kFinished);
  thread_.join();
  const sigset_t set = awaited();
  pthread_sigmask(SIG_UNBLOCK, &set, nullptr);
}

void Interrupt::wait(const std::stop_token& finished) {
  const sigset_t set = awaited();
  int signal = 0;
  sigwait(&set, &signal);
  if (finished.stop_requested()) return;
  requested_.request_stop();
  const sigset_t deadly = interrupts();
  pthread_sigmask(SIG_UNBLOCK, &deadly, nullptr);  // the next one kills the program
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any().wait(lock, finished, [] { return false; });
}

}  // namespace hybrid_slam
