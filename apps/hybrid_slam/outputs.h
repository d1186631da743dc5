#pragma once

#include "apps/hybrid_slam/command_line.h"
#include "apps/hybrid_slam/run_input.h"
#include "apps/io/hybrid_error.h"
#include "apps/io/trajectory.h"
#include "apps/slam/replay.h"

namespace hybrid_slam {

// What is told of a run, in summary.json and on the screen.
struct RunSummary {
  double seconds = 0;                 // from the first image to the last
  std::optional<AbsoluteError> ate;   // where the dataset has truth; SE3 alignment
  std::optional<HybridError> hybrid;  // where it has the truth of both cameras
};

// Writes the map into line.out. Throws OutputError.
void write_map(const CommandLine& line, const MapSnapshot& map, const MapFileInfo& info);

// Writes every file of the run into line.out. Throws OutputError.
RunSummary write_outputs(const CommandLine& line, RunInput& input, const RunResult& result,
                         double seconds);

// A few lines for people.
void print_summary(const CommandLine& line, const RunResult& result, const RunSummary& summary);

}  // namespace hybrid_slam
