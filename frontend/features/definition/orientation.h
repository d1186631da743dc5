#pragma once

#include "frontend/features/definition/patch.h"

// The angles of a feature: peaks of a histogram of the gradients around it (Lowe 2004, section 5).
// The grid has kOrientationSide^2 samples and no turn; bin b stands for the angle b / 36 of a turn.

namespace hybrid_slam::sift {

constexpr int kOrientationSide = 2 * kOrientationRadius + 1;

// The grid of a feature of scale `sigma` at (x, y) [samples].
HS_HOST_DEVICE inline PatchFrame orientation_frame(float x, float y, float sigma) {
  return {x, y, kOrientationStep * sigma, 0.0F};
}

// Of the sample at (column, row) from the middle; 0 outside of a circle.
HS_HOST_DEVICE inline float orientation_window(int column, int row) {
  const int square = column * column + row * row;
  if (square > kOrientationRadius * kOrientationRadius) return 0;
  return expf(-static_cast<float>(square) / (2 * kOrientationSigma * kOrientationSigma));
}

// A gradient's vote goes to two bins, linearly.
struct OrientationVote {
  int lower, upper;          // bins
  float to_lower, to_upper;  // shares of the magnitude, sum 1
};

HS_HOST_DEVICE inline OrientationVote orientation_vote(float turn) {
  const float bin = turn * kOrientationBins;
  const int whole = static_cast<int>(bin);
  const float share = bin - static_cast<float>(whole);
  const int lower = whole >= kOrientationBins ? whole - kOrientationBins : whole;
  const int upper = lower + 1 == kOrientationBins ? 0 : lower + 1;
  return {lower, upper, 1 - share, share};
}

HS_HOST_DEVICE inline int neighbour_bin(int bin, int step) {
  return (bin + step + kOrientationBins) % kOrientationBins;
}

// One bin of the histogram smoothed by (1 4 6 4 1) / 16.
HS_HOST_DEVICE inline float smoothed_bin(const float* histogram, int bin) {
  const auto at = [&](int step) { return histogram[neighbour_bin(bin, step)]; };
  return (at(-2) + at(2)) * (1.0F / 16) + (at(-1) + at(1)) * (4.0F / 16) + at(0) * (6.0F / 16);
}

// Whether a bin of the smoothed histogram with this maximum is a peak that gives an angle, and if
// so, the angle in [0, 2 pi), from a parabola through it and its neighbours.
HS_HOST_DEVICE inline bool orientation_peak(const float* smoothed, float maximum, int bin,
                                            float* angle) {
  const float here = smoothed[bin];
  const float before = smoothed[neighbour_bin(bin, -1)];
  const float after = smoothed[neighbour_bin(bin, 1)];
  if (!(here > before && here >= after && here >= kSecondPeak * maximum)) return false;
  const float offset = 0.5F * (before - after) / (before + after - 2 * here);
  constexpr float kTurn = 6.283185307F;
  float peak = (static_cast<float>(bin) + offset) * (kTurn / kOrientationBins);
  if (peak < 0) peak += kTurn;
  if (peak >= kTurn) peak = 0;
  *angle = peak;
  return true;
}

}  // namespace hybrid_slam::sift
