#include "apps/hybrid_slam/command_line.h"

#include <CLI/CLI.hpp>

#include "apps/hybrid_slam/run_options.h"
#include "frontend/input/bags/bag_files.h"

namespace hybrid_slam {
namespace {

constexpr const char* kIntroduction =
    R"(hybrid_slam check DATASET ... says what the images are fit for, without SLAM; hybrid_slam live ...
listens to cameras, streams and folders that a recorder is writing to; see their --help.)";

constexpr const char* kExitCodes =
    R"(Exit codes: 0 done; 1 internal error; 2 bad usage, no such device, or a port in use;
3 bad input (dataset, configuration or output folder); 4 no frame could be tracked; 130 interrupted, what there was is
saved.)";

}  // namespace

std::optional<CommandLine> parse_command_line(int argc, char** argv, int& exit_code) {
  CommandLine line;
  CLI::App app(
      "Visual SLAM on a sequence of stereo images, and those of a fisheye that moves by itself.",
      "hybrid_slam");
  app.footer(std::string(kIntroduction) + "\n\n" + kWrittenFiles + "\n\n" + kExitCodes);
  add_input_options(app, line.input);
  RunOptions options(app, line);
  app.add_option("--rate", line.rate,
                 "realtime: images per second; those that come too early are dropped and counted")
      ->check(must_be(is_rate, "is no rate between 0.001 and 100000 Hz"));
  const auto end = options.read(argc, argv, [&] {
    check_input_choice(line.input);
    if (line.rate > 0 && line.mode != SessionMode::kRealtime) {
      throw CLI::ValidationError("--rate needs --mode realtime");
    }
  });
  if (end) {
    exit_code = *end;
    return std::nullopt;
  }
  return line;
}

}  // namespace hybrid_slam
