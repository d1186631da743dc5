#pragma once

namespace hybrid_slam {

// Of "hybrid_slam check", beside ExitCode: the input was read, and something in it will spoil the
// SLAM, or may.
constexpr int kExitFindings = 5;

// "hybrid_slam check DATASET [options]"; `argv` begins with "check". Returns the exit code; throws
// InputError.
int run_check_command(int argc, char** argv);

}  // namespace hybrid_slam
