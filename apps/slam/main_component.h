#pragma once

#include "apps/slam/replay.h"

namespace hybrid_slam {

// Counts the components of result.map, and says of each record whether it is in the one that holds
// most of the frames: those of others have poses of another world, and are counted as such. Once,
// at the end.
void settle_components(RunResult& result);

}  // namespace hybrid_slam
