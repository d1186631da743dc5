#include "apps/slam/log.h"

#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/sinks/null_sink.h>
#include <spdlog/spdlog.h>

#include <array>
#include <string_view>

#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

constexpr std::array kNames = {"hybrid_slam.input", "hybrid_slam.tracking", "hybrid_slam.mapping",
                               "hybrid_slam.loops", "hybrid_slam.session"};
constexpr std::array<std::string_view, 6> kLevels = {"trace",   "debug", "info",
                                                     "warning", "error", "off"};

using Loggers = std::array<std::shared_ptr<spdlog::logger>, kNames.size()>;

Loggers make_loggers() {
  Loggers loggers;
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    loggers[i] = spdlog::get(kNames[i]);
    if (loggers[i]) continue;
    loggers[i] = std::make_shared<spdlog::logger>(kNames[i],
                                                  std::make_shared<spdlog::sinks::null_sink_mt>());
    loggers[i]->set_level(spdlog::level::off);
    spdlog::register_logger(loggers[i]);
  }
  return loggers;
}

const Loggers& loggers() {
  static const Loggers all = make_loggers();
  return all;
}

}  // namespace

spdlog::logger& log_of(LogRoom room) { return *loggers()[static_cast<std::size_t>(room)]; }

bool is_log_level(const std::string& level) {
  for (const std::string_view known : kLevels) {
    if (known == level) return true;
  }
  return false;
}

void open_log(const std::string& file, const std::string& level) {
  try {
    const auto sink = std::make_shared<spdlog::sinks::basic_file_sink_mt>(file);
    sink->set_pattern("%Y-%m-%d %H:%M:%S.%e %l %n: %v");
    for (const auto& logger : loggers()) {
      logger->sinks().push_back(sink);
      logger->set_level(spdlog::level::from_str(level));
      logger->flush_on(spdlog::level::trace);  // the last lines before a crash are what counts
    }
  } catch (const spdlog::spdlog_ex& error) {
    throw OutputError(file + ": cannot be written: " + error.what());
  }
}

}  // namespace hybrid_slam
