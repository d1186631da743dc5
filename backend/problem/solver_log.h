#pragma once

namespace hybrid_slam {

// Keeps Ceres' own messages out of a program's output, but for the last words of an abort: what
// matters of the others is in the summaries. To be called once, before anything is solved.
void silence_solver_log();

}  // namespace hybrid_slam
