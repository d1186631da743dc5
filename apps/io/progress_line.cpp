#include "apps/io/progress_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

namespace hybrid_slam {
namespace {

constexpr std::chrono::milliseconds kTerminalInterval{200};
constexpr std::chrono::seconds kPlainInterval{10};

}  // namespace

ProgressLine::ProgressLine(std::string unit, bool quiet)
    : unit_(std::move(unit)),
      quiet_(quiet),
      terminal_(isatty(STDERR_FILENO) != 0),
      start_(Clock::now()),
      last_(start_) {}

void ProgressLine::update(std::size_t done, std::size_t total, const std::string& more) {
  const auto now = Clock::now();
  const auto interval =
      terminal_ ? std::chrono::duration_cast<Clock::duration>(kTerminalInterval) : kPlainInterval;
  if (quiet_ || (now - last_ < interval && (done < total || total == 0))) return;
  last_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const double rate = seconds > 0 ? static_cast<double>(done) / seconds : 0;
  const double left = rate > 0 ? static_cast<double>(total - done) / rate : 0;
  const std::string of_total = total > 0 ? fmt::format("/{}", total) : "";
  const std::string time_left = total > 0 ? fmt::format("  {:.0f} s left", left) : "";
  fmt::print(stderr, "{}{}{} {}  {:.2f}/s{}{}{}{}", terminal_ ? "\r" : "", done, of_total, unit_,
             rate, time_left, more.empty() ? "" : "  ", more, terminal_ ? "\033[K" : "\n");
  open_line_ = terminal_;
  std::fflush(stderr);
}

void ProgressLine::finish() {
  if (open_line_) {
    fmt::print(stderr, "\n");
    open_line_ = false;
  }
}

}  // namespace hybrid_slam
