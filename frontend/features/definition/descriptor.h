#pragma once

#include <cstdint>

#include "frontend/features/definition/patch.h"

// The descriptor: per cell of a grid of 4 x 4 cells a histogram of the gradients' angles, each
// gradient shared linearly among the cells and the bins next to it (Lowe 2004, section 6). Samples
// lie on a grid that is turned with the feature, so the share of a sample in a cell is a constant.
//
// Samples are numbered 0 .. kDescriptorSide - 1 along a side and reach half a cell beyond the cells
// on all sides. Cells and samples along the rows are numbered the same way.

namespace hybrid_slam::sift {

constexpr int kDescriptorSide = (kCells + 1) * kSamplesPerCell;
// A gradient needs the samples next to its own.
constexpr int kDescriptorGrid = kDescriptorSide + 2;

// The grid of a feature of scale `sigma` at (x, y) [samples].
HS_HOST_DEVICE inline PatchFrame descriptor_frame(float x, float y, float sigma, float angle) {
  return patch_frame(x, y, kCellSize / kSamplesPerCell * sigma, angle);
}

// A sample's place from the middle of the descriptor [grid steps].
HS_HOST_DEVICE inline float descriptor_place(int sample) {
  return static_cast<float>(sample) - 0.5F * (kDescriptorSide - 1);
}

// The share of a sample in a cell along one axis, times the Gaussian window along it. It differs
// from 0 for the samples cell * kSamplesPerCell + (0 .. 2 * kSamplesPerCell - 1). A gradient counts
// with the product of both axes.
HS_HOST_DEVICE inline float cell_share(int cell, int sample) {
  const float place = descriptor_place(sample) / kSamplesPerCell;
  const float middle = static_cast<float>(cell) - 0.5F * (kCells - 1);
  const float share = fmaxf(0.0F, 1 - fabsf(place - middle));
  return share * expf(-place * place / (2 * kDescriptorSigma * kDescriptorSigma));
}

// The share of a gradient with this angle in a bin.
HS_HOST_DEVICE inline float bin_share(int bin, float turn) {
  const float distance = fabsf(turn * kDescriptorBins - static_cast<float>(bin));
  return fmaxf(0.0F, 1 - fminf(distance, kDescriptorBins - distance));
}

// From the histogram to bytes: scaled to length 1, cut at kClip, then RootSIFT (Arandjelovic and
// Zisserman 2012): the square root of the shares of the sum, times kQuantum. All 0 for a histogram
// of zeros. `histogram` is overwritten.
HS_HOST_DEVICE inline void root_sift(float* histogram, std::uint8_t* bytes) {
  float squares = 0;
  for (int i = 0; i < kDescriptorSize; ++i) squares += histogram[i] * histogram[i];
  const float largest = kClip * sqrtf(squares);
  float sum = 0;
  for (int i = 0; i < kDescriptorSize; ++i) {
    histogram[i] = fminf(histogram[i], largest);
    sum += histogram[i];
  }
  const float scale = sum > 0 ? kQuantum * kQuantum / sum : 0.0F;
  for (int i = 0; i < kDescriptorSize; ++i) {
    const float root = sqrtf(histogram[i] * scale) + 0.5F;
    bytes[i] = static_cast<std::uint8_t>(fminf(root, 255.0F));
  }
}

}  // namespace hybrid_slam::sift
