#pragma once

#include <optional>
#include <string>

#include "apps/hybrid_slam/command_line.h"

namespace hybrid_slam {

// What the user of "hybrid_slam live" asked for.
struct LiveLine {
  CommandLine run;  // of its input: calibration, what images are, how they become grey, limit
  std::string left, right, fisheye;  // streams; with `watch` folders or patterns in that folder
  bool split = false;                // the left stream holds both images side by side
  std::string watch;                 // a folder; empty: streams
  std::string record;                // a folder; empty: nothing is recorded
  double timeout = 10;               // [s]
  double rate = 0;                   // [Hz]; 0: as the streams say
};

// Of this command alone, beside ExitCode.
constexpr int kExitRecordingIncomplete = 6;

// As parse_command_line().
std::optional<LiveLine> parse_live_line(int argc, char** argv, int& exit_code);

}  // namespace hybrid_slam
