#pragma once

namespace hybrid_slam {

// hybrid_slam live: SLAM on what cameras see now. `argv` begins with the command's own name.
// Returns the exit code.
int run_live_command(int argc, char** argv);

}  // namespace hybrid_slam
