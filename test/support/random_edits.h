#pragma once

#include <cstdint>

#include "test/support/filled_map.h"
#include "test/support/random.h"

namespace hybrid_slam {

// Makes edits at random, half of what they name being stale or clashing. The same seed makes the
// same edits on the same map.
class RandomEdits {
 public:
  // `with_poses`: keyframes come, go and move, too.
  RandomEdits(FilledMap& filled, std::uint64_t seed, bool with_poses = true)
      : filled_(filled), random_(seed), with_poses_(with_poses) {}

  void step();

 private:
  KeyframeId keyframe();
  LandmarkId landmark();
  Observation observation();
  LandmarkObservation existing();
  void add_keyframe();
  KeyframeId newest_like(const Keyframe& keyframe) const;
  void move();

  FilledMap& filled_;
  Random random_;
  bool with_poses_;
};

}  // namespace hybrid_slam
