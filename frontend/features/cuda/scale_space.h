#pragma once

#include <cstddef>

#include "frontend/features/cuda/scale_space_kernels.h"
#include "frontend/features/definition/patch.h"

namespace hybrid_slam::cuda {

// More than any image has that fits into memory.
constexpr int kMaxOctaves = 16;

// Level 0 of an octave after the first is every other sample of a level of the one before.
struct Octave {
  Size size;
  float pixels;         // from a sample to the next
  Source first;         // level 0
  float* levels;        // from level 1
  int first_tile;       // of the search for extrema
  int tiles_across;     // a row of tiles
  std::size_t samples;  // in the octaves before this one, all layers

  HS_HOST_DEVICE float at(int level, int y, int x) const {
    if (level == 0) return first.at(x, y);
    return levels[static_cast<std::size_t>(level - 1) * size.plane +
                  static_cast<std::size_t>(y) * size.stride + x];
  }
  HS_HOST_DEVICE float difference(int k, int y, int x) const {
    return at(k + 1, y, x) - at(k, y, x);
  }
  HS_HOST_DEVICE sift::LevelView level(int level) const {
    return {levels + static_cast<std::size_t>(level - 1) * size.plane, size.stride, size.width,
            size.height};
  }
};

struct ScaleSpace {
  int layers;
  int octaves;
  Octave octave[kMaxOctaves];
};

}  // namespace hybrid_slam::cuda
