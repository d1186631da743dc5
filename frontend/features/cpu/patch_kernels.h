#pragma once

#include <cstdint>

#include "frontend/features/cpu/fixed_level.h"

// Angles and descriptor of one feature on the CPU: what definition/orientation.h and
// definition/descriptor.h say, in vectors of what the machine has.

namespace hybrid_slam::sift {

// A feature in its level [samples].
struct PlaceInLevel {
  float x, y, scale;
};

// How far from a feature its patches reach [scales]: half a side, and half a diagonal.
constexpr float kOrientationReach = kOrientationStep * (kOrientationRadius + 1);
constexpr float kDescriptorReach =
    1.415F * 0.5F * kCellSize * (kCells + 1 + 1.0F / kSamplesPerCell);

// Asks for the samples that the feature's patch of this reach [scales] will need.
void prefetch_patch(const FixedLevel& level, const PlaceInLevel& place, float reach);

// Writes the feature's angles, ascending from 0, to `angles`, which has room for kMaxOrientations,
// and returns how many there are. None where there is no gradient.
int find_angles(const FixedLevel& level, const PlaceInLevel& place, float* angles);

// Writes kDescriptorSize bytes.
void describe(const FixedLevel& level, const PlaceInLevel& place, float angle, std::uint8_t* bytes);

}  // namespace hybrid_slam::sift
