#pragma once

#include <cstddef>
#include <cstdint>

#include "frontend/features/cuda/parallel.h"
#include "frontend/features/definition/scale_space.h"

// The levels of an octave, all at once: each is blurred from the octave's first level by the
// convolution of the kernels that the definition applies one after the other. An image that is
// mirrored at its first and last sample stays so under symmetric kernels, so that this is the same
// up to rounding, borders included. First along the rows, then along the columns. A thread makes
// kRun outputs side by side and reads each sample once for all of them.

namespace hybrid_slam::cuda {

constexpr int kMaxLayers = 10;  // as SiftOptions allows
constexpr int kMaxLevels = kMaxLayers + 2;
constexpr int kMaxReach = 64;  // of a kernel [samples]
constexpr int kRun = 8;

// Samples that a run reads, rounded up to whole runs.
HS_HOST_DEVICE constexpr int taps_of(int reach) { return (2 * reach + 2 * kRun - 1) / kRun * kRun; }
constexpr int kMaxTaps = taps_of(kMaxReach);

// Symmetric kernels: kernel k has 2 * reach[k] + 1 weights at weights + k * kMaxTaps, then zeros.
struct Kernels {
  int reach[kMaxLevels];
  const float* weights;
};

// What is blurred: an image's bytes, with zeros in between if it is upsampled, or samples.
struct Source {
  const std::uint8_t* bytes;  // null: samples
  const float* samples;
  int row_step;
  int column_step;
  bool upsampled;

  HS_HOST_DEVICE float at(int x, int y) const {
    if (bytes == nullptr) {
      return samples[static_cast<std::ptrdiff_t>(y) * row_step + x * column_step];
    }
    if (!upsampled) return bytes[static_cast<std::ptrdiff_t>(y) * row_step + x];
    if ((x | y) & 1) return 0;
    return bytes[static_cast<std::ptrdiff_t>(y / 2) * row_step + x / 2];
  }
};

// sums[j] = sum over t of weights[t] * read(j + t).
template <typename Read>
HS_HOST_DEVICE inline void blur_run(const float* weights, int taps, const Read& read, float* sums) {
  float window[kRun] = {};
  for (int j = 0; j < kRun; ++j) sums[j] = 0;
  for (int t = 0; t < taps; t += kRun) {
    HS_UNROLL
    for (int u = 0; u < kRun; ++u) {
      HS_UNROLL
      for (int j = kRun - 1; j > 0; --j) window[j] = window[j - 1];
      window[0] = weights[t + u];
      const float sample = read(t + u);
      HS_UNROLL
      for (int j = 0; j < kRun; ++j) sums[j] += window[j] * sample;
    }
  }
}

// Columns with gaps: runs that lie side by side start in different banks of shared memory.
HS_HOST_DEVICE constexpr int padded(int column) { return column + column / kRun; }

struct Size {
  int width;
  int height;
  int stride;         // samples from a row to the next
  std::size_t plane;  // samples from a level to the next
};

// Grid: tiles of columns, tiles of rows, levels.
struct BlurRows {
  static constexpr int kThreads = 128;
  static constexpr int kRows = 8;
  static constexpr int kColumns = 128;
  static constexpr int kThreadsPerRow = kThreads / kRows;
  static constexpr int kRowStep = padded(kColumns + kMaxTaps - kRun) + 16;

  struct Shared {
    float weights[kMaxTaps];
    float in[kRows][kRowStep];
    float out[kRows][padded(kColumns)];
  };

  Source in;
  Size size;
  Kernels kernels;
  float* out;

  HS_HOST_DEVICE void operator()(const Block& block, Shared& shared) const {
    const int reach = kernels.reach[block.z];
    const int taps = taps_of(reach);
    const int x0 = block.x * kColumns;
    const int y0 = block.y * kRows;
    block.each(kThreads, [&](int i) {
      for (int t = i; t < taps; t += kThreads) {
        shared.weights[t] = kernels.weights[block.z * kMaxTaps + t];
      }
      const int row = i / kThreadsPerRow;
      const int y = y0 + row < size.height ? y0 + row : size.height - 1;
      for (int c = i % kThreadsPerRow; c < kColumns + taps - kRun; c += kThreadsPerRow) {
        shared.in[row][padded(c)] = in.at(sift::mirrored(x0 + c - reach, size.width), y);
      }
    });
    block.each(kThreads, [&](int i) {
      const int row = i / kThreadsPerRow;
      const int run = i % kThreadsPerRow;
      const float* first = shared.in[row] + padded(run * kRun);
      float sums[kRun];
      blur_run(
          shared.weights, taps, [&](int t) { return first[padded(t)]; }, sums);
      float* to = shared.out[row] + padded(run * kRun);
      for (int j = 0; j < kRun; ++j) to[j] = sums[j];
    });
    block.each(kRows * kColumns, [&](int i) {
      const int x = x0 + i % kColumns;
      const int y = y0 + i / kColumns;
      if (x >= size.width || y >= size.height) return;
      float* level = out + static_cast<std::size_t>(block.z) * size.plane;
      level[static_cast<std::ptrdiff_t>(y) * size.stride + x] =
          shared.out[i / kColumns][padded(i % kColumns)];
    });
  }
};

// Grid: tiles of columns, tiles of rows, levels.
struct BlurColumns {
  static constexpr int kThreads = 256;
  static constexpr int kColumns = 32;
  static constexpr int kRows = kThreads / kColumns * kRun;

  struct Shared {
    float weights[kMaxTaps];
    float in[kRows + kMaxTaps - kRun][kColumns];
  };

  const float* in;
  Size size;
  Kernels kernels;
  float* out;

  HS_HOST_DEVICE void operator()(const Block& block, Shared& shared) const {
    const int reach = kernels.reach[block.z];
    const int taps = taps_of(reach);
    const int x0 = block.x * kColumns;
    const int y0 = block.y * kRows;
    const std::size_t level = static_cast<std::size_t>(block.z) * size.plane;
    block.each(kThreads, [&](int i) {
      for (int t = i; t < taps; t += kThreads) {
        shared.weights[t] = kernels.weights[block.z * kMaxTaps + t];
      }
      const int column = i % kColumns;
      const int x = x0 + column < size.width ? x0 + column : size.width - 1;
      for (int row = i / kColumns; row < kRows + taps - kRun; row += kThreads / kColumns) {
        const int y = sift::mirrored(y0 + row - reach, size.height);
        shared.in[row][column] = in[level + static_cast<std::size_t>(y) * size.stride + x];
      }
    });
    block.each(kThreads, [&](int i) {
      const int column = i % kColumns;
      const int first = i / kColumns * kRun;
      float sums[kRun];
      blur_run(
          shared.weights, taps, [&](int t) { return shared.in[first + t][column]; }, sums);
      for (int j = 0; j < kRun; ++j) {
        const int y = y0 + first + j;
        if (x0 + column >= size.width || y >= size.height) return;
        out[level + static_cast<std::size_t>(y) * size.stride + x0 + column] = sums[j];
      }
    });
  }
};

}  // namespace hybrid_slam::cuda
