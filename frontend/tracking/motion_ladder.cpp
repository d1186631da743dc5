#include "frontend/tracking/motion_ladder.h"

#include <utility>

#include "frontend/odometry/left_motion.h"

namespace hybrid_slam {

std::optional<LadderStep> MotionLadder::climb(const Frame& from, const Frame& to) const {
  std::optional<LadderStep> best;
  // True if the ladder ends here.
  const auto take = [&](std::optional<StereoMotion> motion, Prediction rung) {
    if (!motion) return false;
    const bool believed = is_believed(motion->support);
    if (believed || (!best && is_no_accident(motion->support))) {
      best = LadderStep{std::move(*motion), rung, believed};
    }
    return believed;
  };
  if (take(odometer_.estimate(from.features, to.features), Prediction::kOdometer) ||
      take(motion_by_left_matches(camera_, from.features, to.features), Prediction::kLeftMatches) ||
      !from.image || !to.image) {
    return best;
  }
  take(motion_by_patches(camera_, from.features, *from.image, *to.image), Prediction::kPatches);
  return best;
}

}  // namespace hybrid_slam
