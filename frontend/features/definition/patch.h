#pragma once

#include <cmath>

#include "frontend/features/definition/parameters.h"

// Reading a level of the scale space on a grid around a feature, and the gradients of such a grid.
// A level's blur is 1.8 samples at least, so that reading it between samples, linearly, loses
// nothing, and steps of 0.75 scales are as good as all samples. Samples are whole numbers of 16
// bits here, so that an engine can keep the levels in half the memory of floats: they are rounded
// by 0.001 grey levels, far below the noise of any image.

namespace hybrid_slam::sift {

constexpr float kLevelUnits = 256;  // per grey level: what is read from a level is in these

// A level in grey levels, or, of integers, in units.
template <typename Sample>
struct LevelOf {
  const Sample* samples;  // of the first row
  long stride;            // samples from a row to the next
  int width;
  int height;
};

using LevelView = LevelOf<float>;

// Where a grid lies in a level: its middle and the step along its columns, in samples; a step along
// its rows is the same, turned by 90 degrees from +x to +y.
struct PatchFrame {
  float x, y;
  float step_x, step_y;
};

HS_HOST_DEVICE inline PatchFrame patch_frame(float x, float y, float step, float angle) {
  return {x, y, step * cosf(angle), step * sinf(angle)};
}

HS_HOST_DEVICE inline float units_of(float sample) { return rintf(sample * kLevelUnits); }
HS_HOST_DEVICE inline float units_of(unsigned short sample) { return sample; }

// Linear interpolation; beyond the image's sides the nearest place on them.
template <typename Sample>
HS_HOST_DEVICE inline float read_level(const LevelOf<Sample>& level, float x, float y) {
  x = fminf(fmaxf(x, 0.0F), static_cast<float>(level.width - 1));
  y = fminf(fmaxf(y, 0.0F), static_cast<float>(level.height - 1));
  int column = static_cast<int>(x);
  int row = static_cast<int>(y);
  if (column > level.width - 2) column = level.width - 2;
  if (row > level.height - 2) row = level.height - 2;
  const float fx = x - static_cast<float>(column);
  const float fy = y - static_cast<float>(row);
  const Sample* above = level.samples + row * level.stride + column;
  const Sample* below = above + level.stride;
  const float left = units_of(above[0]);
  const float lower_left = units_of(below[0]);
  const float upper = left + fx * (units_of(above[1]) - left);
  const float lower = lower_left + fx * (units_of(below[1]) - lower_left);
  return upper + fy * (lower - upper);
}

// The level at (column, row) of the grid, counted from its middle.
template <typename Sample>
HS_HOST_DEVICE inline float read_patch(const LevelOf<Sample>& level, const PatchFrame& frame,
                                       float column, float row) {
  return read_level(level, frame.x + column * frame.step_x - row * frame.step_y,
                    frame.y + column * frame.step_y + row * frame.step_x);
}

// The angle of (x, y) in turns, 0 .. 1, within kTurnError of atan2 / (2 pi); 0 for (0, 0). From a
// polynomial for atan(q) / (2 pi) over 0 <= q <= 1: q (kTurn1 + kTurn3 q^2 + ... + kTurn9 q^8).
constexpr float kTurnError = 3e-6F;
constexpr float kTurn1 = 0.15913368F;
constexpr float kTurn3 = -0.0525698217F;
constexpr float kTurn5 = 0.0286740223F;
constexpr float kTurn7 = -0.0135542527F;
constexpr float kTurn9 = 0.0033182038F;
constexpr float kSmallestGradient = 1e-30F;  // smaller ones have no angle

HS_HOST_DEVICE inline float turn_of(float x, float y) {
  const float ax = fabsf(x);
  const float ay = fabsf(y);
  const float q = fminf(ax, ay) / fmaxf(fmaxf(ax, ay), kSmallestGradient);
  const float q2 = q * q;
  float turn = q * ((((kTurn9 * q2 + kTurn7) * q2 + kTurn5) * q2 + kTurn3) * q2 + kTurn1);
  if (ay > ax) turn = 0.25F - turn;
  if (x < 0) turn = 0.5F - turn;
  if (y < 0) turn = 1.0F - turn;
  return turn;
}

struct Gradient {
  float magnitude;  // of the difference over two grid steps
  float turn;       // its angle against the grid's columns, 0 .. 1
};

// From the four neighbours in the grid.
HS_HOST_DEVICE inline Gradient gradient(float left, float right, float above, float below) {
  const float dx = right - left;
  const float dy = below - above;
  return {sqrtf(dx * dx + dy * dy), turn_of(dx, dy)};
}

}  // namespace hybrid_slam::sift
