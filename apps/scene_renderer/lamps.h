#pragma once

#include <vector>

#include "apps/scene_renderer/rig_motion.h"
#include "apps/scene_renderer/water.h"

namespace hybrid_slam {

// The lamps where they are at one moment: two on the vehicle, one on the wrist if there is a
// fisheye. Another visit has them mounted at most 0.2 m (on the wrist 0.05 m) elsewhere, of 0.7 to
// 1.3 times the power and of a slightly different colour.
std::vector<Lamp> lamps_at(const SceneOptions& options, const RigMoment& moment);

}  // namespace hybrid_slam
