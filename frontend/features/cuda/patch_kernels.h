#pragma once

#include <cstdint>

#include "backend/map/features.h"
#include "frontend/features/cuda/response_order.h"
#include "frontend/features/cuda/scale_space.h"
#include "frontend/features/cuda/selection_kernels.h"
#include "frontend/features/definition/descriptor.h"
#include "frontend/features/definition/orientation.h"

// Angles and descriptors, a block per feature. Histograms are gathered: a thread sums up what goes
// to its bin, always in the same order.

namespace hybrid_slam::cuda {

// Samples of a square grid around a feature.
template <int kSide>
struct Patch {
  float samples[kSide][kSide];

  HS_HOST_DEVICE void read(int i, const sift::LevelView& level, const sift::PatchFrame& frame) {
    constexpr float kMiddle = 0.5F * (kSide - 1);
    const int row = i / kSide;
    const int column = i % kSide;
    samples[row][column] = sift::read_patch(level, frame, static_cast<float>(column) - kMiddle,
                                            static_cast<float>(row) - kMiddle);
  }
  // Of the grid without its rim.
  HS_HOST_DEVICE sift::Gradient gradient(int row, int column) const {
    return sift::gradient(samples[row + 1][column], samples[row + 1][column + 2],
                          samples[row][column + 1], samples[row + 2][column + 1]);
  }
};

// Grid: as many blocks as extrema may have been selected.
struct FindAngles {
  static constexpr int kThreads = 64;
  static constexpr int kSide = sift::kOrientationSide;

  struct Shared {
    Patch<kSide + 2> patch;
    sift::OrientationVote votes[kSide * kSide];  // shares of the weighted magnitude
    float histogram[sift::kOrientationBins];
    float smoothed[sift::kOrientationBins];
  };

  ScaleSpace scale_space;
  Spread selection;  // of the extrema
  const Extremum* extrema;
  float* angles;  // kMaxOrientations for each, ascending
  int* counts;    // of angles

  HS_HOST_DEVICE void operator()(const Block& block, Shared& shared) const {
    if (block.x >= selection.selected()) return;
    const Extremum extremum = extrema[block.x];
    const sift::LevelView level = scale_space.octave[extremum.octave].level(extremum.level);
    const sift::PatchFrame frame =
        sift::orientation_frame(extremum.level_x, extremum.level_y, extremum.level_scale);
    block.each((kSide + 2) * (kSide + 2), [&](int i) { shared.patch.read(i, level, frame); });
    block.each(kSide * kSide, [&](int i) {
      const sift::Gradient gradient = shared.patch.gradient(i / kSide, i % kSide);
      sift::OrientationVote vote = sift::orientation_vote(gradient.turn);
      const float weight =
          gradient.magnitude * sift::orientation_window(i % kSide - sift::kOrientationRadius,
                                                        i / kSide - sift::kOrientationRadius);
      vote.to_lower *= weight;
      vote.to_upper *= weight;
      shared.votes[i] = vote;
    });
    block.each(sift::kOrientationBins, [&](int bin) {
      float sum = 0;
      for (const sift::OrientationVote& vote : shared.votes) {
        if (vote.lower == bin) sum += vote.to_lower;
        if (vote.upper == bin) sum += vote.to_upper;
      }
      shared.histogram[bin] = sum;
    });
    block.each(sift::kOrientationBins,
               [&](int bin) { shared.smoothed[bin] = sift::smoothed_bin(shared.histogram, bin); });
    block.each(1, [&](int) { write_peaks(block.x, shared.smoothed); });
  }

 private:
  HS_HOST_DEVICE void write_peaks(int extremum, const float* smoothed) const {
    float maximum = 0;
    for (int bin = 0; bin < sift::kOrientationBins; ++bin) maximum = fmaxf(maximum, smoothed[bin]);
    float* found = angles + extremum * sift::kMaxOrientations;
    int count = 0;
    for (int bin = 0; bin < sift::kOrientationBins && count < sift::kMaxOrientations; ++bin) {
      float angle;
      if (!sift::orientation_peak(smoothed, maximum, bin, &angle)) continue;
      int at = count++;
      for (; at > 0 && found[at - 1] > angle; --at) found[at] = found[at - 1];
      found[at] = angle;
    }
    counts[extremum] = count;
  }
};

// An extremum with one of its angles.
struct Oriented {
  int extremum;
  float angle;
};

// One block.
struct PlaceAngles {
  static constexpr int kThreads = kScanSize;
  using Shared = Scan;

  Spread selection;  // of the extrema
  const int* counts;
  int* firsts;  // per extremum
  int* total;

  HS_HOST_DEVICE void operator()(const Block& block, Shared& scan) const {
    const int extrema = selection.selected();
    int before = 0;
    for (int first = 0; first < extrema; first += kScanSize) {
      block.each(kScanSize,
                 [&](int i) { scan.values[i] = first + i < extrema ? counts[first + i] : 0; });
      running_sums(block, scan);
      block.each(kScanSize, [&](int i) {
        if (first + i < extrema) firsts[first + i] = before + scan.before(i);
      });
      before += scan.total;
    }
    block.each(1, [&](int) { *total = before; });
  }
};

// Any number of blocks.
struct ListAngles {
  static constexpr int kThreads = 256;
  using Shared = NothingShared;

  Spread selection;  // of the extrema
  const Extremum* extrema;
  const float* angles;
  const int* counts;
  const int* firsts;
  Oriented* oriented;
  Spread spread;  // which they are entered into

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(selection.selected(), [&](int i) {
      for (int k = 0; k < counts[i]; ++k) {
        oriented[firsts[i] + k] = {i, angles[i * sift::kMaxOrientations + k]};
        spread.enter(firsts[i] + k, extrema[i].x, extrema[i].y);
      }
    });
  }
};

// Any number of blocks.
struct GatherOriented {
  static constexpr int kThreads = 256;
  using Shared = NothingShared;

  Spread spread;
  const Oriented* oriented;
  Oriented* selected;
  int* count;  // of them

  HS_HOST_DEVICE void operator()(const Block& block, Shared&) const {
    block.each_of_grid(*spread.count, [&](int i) {
      const int position = spread.position(i);
      if (position >= 0) selected[position] = oriented[i];
    });
    if (block.x == 0) block.each(1, [&](int) { *count = spread.selected(); });
  }
};

// Grid: as many blocks as features may have been selected.
struct Describe {
  static constexpr int kThreads = sift::kDescriptorSize;
  static constexpr int kSide = sift::kDescriptorSide;
  static constexpr int kReach = 2 * sift::kSamplesPerCell;  // samples that a cell has a share of
  static constexpr int kParts = 16;                         // of a sum over the descriptor

  struct Shared {
    Patch<sift::kDescriptorGrid> patch;
    float shares[sift::kCells][kReach];
    sift::Gradient gradients[kSide][kSide];
    float histogram[sift::kDescriptorSize];
    float squares[kParts];
    float sums[kParts];
  };

  ScaleSpace scale_space;
  const int* count;
  const Extremum* extrema;
  const Oriented* features;
  Keypoint* keypoints;
  std::uint8_t* descriptors;

  HS_HOST_DEVICE void operator()(const Block& block, Shared& shared) const {
    if (block.x >= *count) return;
    const Oriented feature = features[block.x];
    const Extremum extremum = extrema[feature.extremum];
    const sift::LevelView level = scale_space.octave[extremum.octave].level(extremum.level);
    const sift::PatchFrame frame = sift::descriptor_frame(extremum.level_x, extremum.level_y,
                                                          extremum.level_scale, feature.angle);
    block.each(sift::kDescriptorGrid * sift::kDescriptorGrid, [&](int i) {
      shared.patch.read(i, level, frame);
      if (i < sift::kCells * kReach) {
        const int cell = i / kReach;
        shared.shares[cell][i % kReach] =
            sift::cell_share(cell, cell * sift::kSamplesPerCell + i % kReach);
      }
      if (i == 0) {
        keypoints[block.x] = {extremum.x,    extremum.y,        extremum.scale,
                              feature.angle, extremum.response, 0};
      }
    });
    block.each(kSide * kSide, [&](int i) {
      shared.gradients[i / kSide][i % kSide] = shared.patch.gradient(i / kSide, i % kSide);
    });
    block.each(sift::kDescriptorSize, [&](int i) { shared.histogram[i] = bin_sum(i, shared); });
    const float squares = sum(block, shared.squares,
                              [&](int i) { return shared.histogram[i] * shared.histogram[i]; });
    const float largest = sift::kClip * sqrtf(squares);
    const float total =
        sum(block, shared.sums, [&](int i) { return fminf(shared.histogram[i], largest); });
    const float scale = total > 0 ? sift::kQuantum * sift::kQuantum / total : 0.0F;
    block.each(sift::kDescriptorSize, [&](int i) {
      const float root = sqrtf(fminf(shared.histogram[i], largest) * scale) + 0.5F;
      descriptors[static_cast<std::size_t>(block.x) * sift::kDescriptorSize + i] =
          static_cast<std::uint8_t>(fminf(root, 255.0F));
    });
  }

 private:
  HS_HOST_DEVICE static float bin_sum(int i, const Shared& shared) {
    const int bin = i % sift::kDescriptorBins;
    const int column = i / sift::kDescriptorBins % sift::kCells;
    const int row = i / sift::kDescriptorBins / sift::kCells;
    float all = 0;
    for (int v = 0; v < kReach; ++v) {
      const sift::Gradient* gradients =
          shared.gradients[row * sift::kSamplesPerCell + v] + column * sift::kSamplesPerCell;
      float of_row = 0;
      HS_UNROLL
      for (int u = 0; u < kReach; ++u) {
        of_row += shared.shares[column][u] *
                  (gradients[u].magnitude * sift::bin_share(bin, gradients[u].turn));
      }
      all += shared.shares[row][v] * of_row;
    }
    return all;
  }

  // Of value(i) over the descriptor, by way of `parts`, which nothing else uses: threads read them
  // without a barrier after it.
  template <typename Value>
  HS_HOST_DEVICE static float sum(const Block& block, float* parts, const Value& value) {
    block.each(kParts, [&](int part) {
      float of_part = 0;
      for (int i = part; i < sift::kDescriptorSize; i += kParts) of_part += value(i);
      parts[part] = of_part;
    });
    float all = 0;
    for (int part = 0; part < kParts; ++part) all += parts[part];
    return all;
  }
};

}  // namespace hybrid_slam::cuda
