#pragma once

#include <cstddef>
#include <cstdint>

namespace hybrid_slam {

inline constexpr std::size_t kMaxOctaves = 16;

// One point per octave, in its lattice's units. Octaves from `count` on have the weight 0.
struct OctavePoints {
  alignas(64) float x[kMaxOctaves] = {};
  alignas(64) float y[kMaxOctaves] = {};
  alignas(64) float z[kMaxOctaves] = {};
  alignas(64) float weight[kMaxOctaves] = {};
  alignas(64) std::uint32_t seed[kMaxOctaves] = {};
  std::size_t count = 0;
};

// Weighted sum of gradient noise (see noise.h) over the octaves: value, then the gradient's x, y
// and z. By the best instructions that the machine has.
void sum_octaves(const OctavePoints& points, float* sum);

}  // namespace hybrid_slam
