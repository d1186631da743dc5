#pragma once

#include <cstdint>

#include "frontend/features/cuda/response_order.h"
#include "frontend/features/cuda/scale_space.h"
#include "frontend/features/definition/extremum.h"

namespace hybrid_slam::cuda {

// Extrema found, in any order: what follows sorts them.
struct Found {
  int* count;  // may exceed the capacity; those beyond are not stored
  int capacity;
  Extremum* extrema;
  int* bucket_sizes;  // see response_order.h

  HS_HOST_DEVICE int stored() const { return *count < capacity ? *count : capacity; }
};

// Searches all layers of a tile of an octave. Grid: the tiles of all octaves.
struct FindExtrema {
  static constexpr int kThreads = 256;
  static constexpr int kColumns = 32;
  static constexpr int kRows = kThreads / kColumns;
  // Of maxima that are larger than all samples around them, and of minima, there are no more.
  static constexpr int kMostPerLayer = 2 * (kColumns / 2) * (kRows / 2);

  struct Shared {
    float differences[kMaxLayers + 2][kRows + 2][kColumns + 2];
    int count;
    std::uint16_t candidates[kMaxLayers * kMostPerLayer];  // (layer - 1) * kThreads + place in tile
  };

  ScaleSpace scale_space;
  float initial_sigma;
  float contrast_threshold;
  float edge_threshold;
  const std::uint8_t* mask;  // null: none
  int width;                 // of the image and the mask
  int height;
  unsigned* claimed;  // a bit for each sample of each layer: an extremum has been fitted there
  Found found;

  HS_HOST_DEVICE void operator()(const Block& block, Shared& shared) const {
    int number = scale_space.octaves - 1;
    while (scale_space.octave[number].first_tile > block.x) --number;
    const Octave& octave = scale_space.octave[number];
    const int tile = block.x - octave.first_tile;
    const int x0 = sift::kBorder + tile % octave.tiles_across * kColumns;
    const int y0 = sift::kBorder + tile / octave.tiles_across * kRows;
    load(block, octave, x0, y0, shared);
    const int layers = scale_space.layers;
    block.each(layers * kThreads, [&](int i) {
      const int column = i % kColumns;
      const int row = i % kThreads / kColumns;
      if (x0 + column >= octave.size.width - sift::kBorder) return;
      if (y0 + row >= octave.size.height - sift::kBorder) return;
      const int layer = 1 + i / kThreads;
      const float value = shared.differences[layer][row + 1][column + 1];
      if (!(fabsf(value) > sift::kSampleContrast * contrast_threshold)) return;
      const float* rows[9];
      for (int k = 0; k < 9; ++k) {
        rows[k] = &shared.differences[layer + k / 3 - 1][row + k % 3][column + 1];
      }
      if (!sift::is_extremum(rows)) return;
      shared.candidates[add_to(&shared.count, 1)] = static_cast<std::uint16_t>(i);
    });
    block.each(shared.count, [&](int k) {
      const int i = shared.candidates[k];
      refine(octave, number, 1 + i / kThreads, y0 + i % kThreads / kColumns, x0 + i % kColumns);
    });
  }

 private:
  HS_HOST_DEVICE void load(const Block& block, const Octave& octave, int x0, int y0,
                           Shared& shared) const {
    constexpr int kWidth = kColumns + 2;
    constexpr int kSamples = kWidth * (kRows + 2);
    block.each(kSamples, [&](int i) {
      if (i == 0) shared.count = 0;
      const int x = x0 - 1 + i % kWidth;
      const int y = y0 - 1 + i / kWidth;
      const bool inside = x < octave.size.width && y < octave.size.height;
      float below = inside ? octave.at(0, y, x) : 0.0F;
      for (int k = 0; k < scale_space.layers + 2; ++k) {
        const float here = inside ? octave.at(k + 1, y, x) : 0.0F;
        shared.differences[k][i / kWidth][i % kWidth] = here - below;
        below = here;
      }
    });
  }

  HS_HOST_DEVICE void refine(const Octave& octave, int number, int layer, int y, int x) const {
    float samples[27];
    const auto rows_at = [&](int k, int row, int column, const float** rows) {
      for (int i = 0; i < 27; ++i) {
        samples[i] = octave.difference(k + i / 9 - 1, row + i / 3 % 3 - 1, column + i % 3 - 1);
      }
      for (int i = 0; i < 9; ++i) rows[i] = samples + 3 * i + 1;
    };
    const sift::ExtremumLimits limits{scale_space.layers, octave.size.height, octave.size.width,
                                      contrast_threshold, edge_threshold};
    sift::RefinedExtremum refined;
    if (!sift::refine_extremum(rows_at, limits, layer, y, x, &refined)) return;
    const Extremum extremum = placed(octave, number, refined);
    if (mask != nullptr && masked(extremum)) return;
    const std::size_t row = static_cast<std::size_t>(refined.layer - 1) * octave.size.height +
                            static_cast<std::size_t>(refined.y);
    // Two samples whose refinement ends at the same one are the same extremum.
    if (set_bit(claimed, octave.samples + row * octave.size.width + refined.x)) return;
    const int slot = add_to(found.count, 1);
    if (slot >= found.capacity) return;
    found.extrema[slot] = extremum;
    add_to(found.bucket_sizes + bucket_of(extremum.response), 1);
  }

  HS_HOST_DEVICE Extremum placed(const Octave& octave, int number,
                                 const sift::RefinedExtremum& refined) const {
    const float layer = static_cast<float>(refined.layer) + refined.to_layer;
    const int nearest = static_cast<int>(lroundf(layer));
    Extremum extremum;
    extremum.octave = static_cast<std::int16_t>(number);
    extremum.level = static_cast<std::int16_t>(nearest < 1                    ? 1
                                               : nearest > scale_space.layers ? scale_space.layers
                                                                              : nearest);
    extremum.level_x = static_cast<float>(refined.x) + refined.to_x;
    extremum.level_y = static_cast<float>(refined.y) + refined.to_y;
    extremum.level_scale = sift::level_sigma(initial_sigma, scale_space.layers, layer);
    extremum.x = extremum.level_x * octave.pixels;
    extremum.y = extremum.level_y * octave.pixels;
    extremum.scale = extremum.level_scale * octave.pixels;
    extremum.response = refined.response;
    return extremum;
  }

  HS_HOST_DEVICE bool masked(const Extremum& extremum) const {
    const int x = static_cast<int>(lroundf(extremum.x));
    const int y = static_cast<int>(lroundf(extremum.y));
    const int column = x < 0 ? 0 : x < width ? x : width - 1;
    const int row = y < 0 ? 0 : y < height ? y : height - 1;
    return mask[static_cast<std::ptrdiff_t>(row) * width + column] == 0;
  }
};

}  // namespace hybrid_slam::cuda
