#pragma once

#include <memory>

#include "apps/hybrid_slam/command_line.h"
#include "apps/hybrid_slam/run_input.h"
#include "apps/view/live_view.h"

// What all runs of the program do, whatever their images come from.
namespace hybrid_slam {

// The map to go on with, how the session shall work, and where it can be watched, or null.
struct PreparedRun {
  Map map;
  SessionOptions session;
  std::unique_ptr<LiveView> view;
};

// Reads what files the command line names beside the images, and takes the port of --view. Throws
// InputError, or AddressError.
PreparedRun prepare_run(const CommandLine& line);

// Before hours of work, not after: can the results be written? Makes the folder, opens the log.
// Throws OutputError.
void begin_outputs(const CommandLine& line);

// Runs it, writes all that there is to write, and returns the exit code. `cancelled`: ends it at
// once, with what there is.
int run_slam(const CommandLine& line, PreparedRun prepared, RunInput& input,
             const std::stop_token& cancelled);

}  // namespace hybrid_slam
