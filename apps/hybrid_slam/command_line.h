#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/hybrid_slam/input_choice.h"
#include "apps/slam/session_types.h"
#include "apps/slam/slam_options.h"
#include "apps/view/http_server.h"
#include "frontend/features/sift_device.h"

namespace hybrid_slam {

// What the user asked for.
struct CommandLine {
  InputChoice input;
  std::string out = "out";
  SessionMode mode = SessionMode::kEveryFrame;
  double rate = 0;                       // [Hz]; 0: images wait for the pipeline
  int threads = 0;                       // 0: one per core
  SiftDevice device = SiftDevice::kCpu;  // that SIFT runs on
  int checkpoint_every = 0;              // keyframes; 0: never
  bool quiet = false;
  bool report = true;                 // write report.html
  std::optional<ServerOptions> view;  // where the run can be watched; none: nowhere
  std::string map;                    // a file to go on with; empty: a new map
  bool localize = false;              // track in the map without changing it
  std::string log;                    // a file; empty: none
  std::string log_level = "info";
  std::string vocabulary;  // a file; empty: the one that is part of the program
  SlamOptions options;
};

// Of this program alone, beside ExitCode.
constexpr int kExitNothingTracked = 4;

// Reads the command line and the configuration file it names. Empty if the program shall end at
// once with `exit_code` (help, or bad usage, which has been reported). Throws InputError for the
// file.
std::optional<CommandLine> parse_command_line(int argc, char** argv, int& exit_code);

}  // namespace hybrid_slam
