#pragma once

#include <optional>
#include <string>

#include "apps/io/graphs/graph_file.h"
#include "apps/map_optimizer/problem.h"

namespace hybrid_slam {

// What the user asked for.
struct CommandLine {
  std::string input;
  std::string out = "out";
  std::optional<GraphFormat> format;  // of the result; none: the input's
  OptimizerOptions options;
  bool quiet = false;
};

// Of this program alone, beside ExitCode.
constexpr int kExitNoSolution = 4;

// Reads the command line. Empty if the program shall end at once with `exit_code` (help, or bad
// usage, which has been reported).
std::optional<CommandLine> parse_command_line(int argc, char** argv, int& exit_code);

}  // namespace hybrid_slam
