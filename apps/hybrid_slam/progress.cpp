#include "apps/hybrid_slam/progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

namespace hybrid_slam {
namespace {

constexpr std::chrono::milliseconds kTerminalInterval{200};
constexpr std::chrono::seconds kPlainInterval{10};

}  // namespace

ProgressPrinter::ProgressPrinter(bool quiet)
    : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0), start_(Clock::now()), last_(start_) {}

void ProgressPrinter::operator()(const RunProgress& progress) {
  const auto now = Clock::now();
  const auto interval =
      terminal_ ? std::chrono::duration_cast<Clock::duration>(kTerminalInterval) : kPlainInterval;
  if (quiet_ || (now - last_ < interval && progress.done < progress.total)) {
    return;
  }
  last_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const double rate = seconds > 0 ? static_cast<double>(progress.done) / seconds : 0;
  const double left = rate > 0 ? static_cast<double>(progress.total - progress.done) / rate : 0;
  fmt::print(stderr,
             "{}{}/{} frames  {:.2f}/s  {:.0f} s left  lost {}  keyframes {}  landmarks {}{}",
             terminal_ ? "\r" : "", progress.done, progress.total, rate, left, progress.frames.lost,
             progress.keyframes, progress.landmarks, terminal_ ? "\033[K" : "\n");
  open_line_ = terminal_;
  std::fflush(stderr);
}

void ProgressPrinter::finish() {
  if (open_line_) {
    fmt::print(stderr, "\n");
    open_line_ = false;
  }
}

}  // namespace hybrid_slam
