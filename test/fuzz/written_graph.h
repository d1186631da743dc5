#pragma once

#include "apps/io/graphs/graph_file.h"
#include "test/fuzz/fuzz_target.h"

namespace hybrid_slam {

// What was read must be a graph that can be solved, and can be written in the format it came in.
void check_written(const GraphFile& file);

}  // namespace hybrid_slam
