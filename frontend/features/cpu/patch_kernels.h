#pragma once

#include <cstdint>

#include "frontend/features/definition/patch.h"

// Angles and descriptor of one feature on the CPU: what definition/orientation.h and
// definition/descriptor.h say, in vectors of what the machine has.

namespace hybrid_slam::sift {

// A feature in its level [samples].
struct PlaceInLevel {
  float x, y, scale;
};

// Writes the feature's angles, ascending from 0, to `angles`, which has room for kMaxOrientations,
// and returns how many there are. None where there is no gradient.
int find_angles(const LevelView& level, const PlaceInLevel& place, float* angles);

// Writes kDescriptorSize bytes.
void describe(const LevelView& level, const PlaceInLevel& place, float angle, std::uint8_t* bytes);

}  // namespace hybrid_slam::sift
