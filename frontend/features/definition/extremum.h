#pragma once

#include <cmath>

#include "frontend/features/definition/parameters.h"

// Extrema of the differences of Gaussians: which samples they are, where they lie between samples,
// and which are kept.
//
// A neighbourhood is nine pointers: rows[3 * a + b] points at the column of the sample itself, in
// the row b - 1 below it (y + b - 1) of the difference a - 1 above it (k + a - 1).

namespace hybrid_slam::sift {

// Whether the sample in the middle is the largest of the 27 and positive, or the smallest and
// negative. Of equal ones that touch, the last in the order of k, y, x is taken.
HS_HOST_DEVICE inline bool is_extremum(const float* const* rows) {
  const float value = rows[4][0];
  if (value == 0) return false;
  const float sign = value > 0 ? 1.0F : -1.0F;
  for (int i = 0; i < 27; ++i) {
    const float excess = sign * (value - rows[i / 3][i % 3 - 1]);
    if (i < 13 ? excess < 0 : i > 13 && excess <= 0) return false;
  }
  return true;
}

// A parabola through a neighbourhood, by Newton's step from the sample (Brown and Lowe 2002).
struct Fit {
  float x, y, layer;  // of the extremum, relative to the sample [samples, layers]
  float value;        // there
  bool edge;          // the ratio of principal curvatures in the image plane is too large
};

// `edge_threshold` r: an edge has trace^2 / determinant >= (r + 1)^2 / r (Lowe 2004, section 4.1).
// Offsets are not finite where the parabola has no extremum.
HS_HOST_DEVICE inline Fit fit_extremum(const float* const* rows, float edge_threshold) {
  const float v = rows[4][0];
  const float gx = 0.5F * (rows[4][1] - rows[4][-1]);
  const float gy = 0.5F * (rows[5][0] - rows[3][0]);
  const float gs = 0.5F * (rows[7][0] - rows[1][0]);
  const float xx = rows[4][1] + rows[4][-1] - 2 * v;
  const float yy = rows[5][0] + rows[3][0] - 2 * v;
  const float ss = rows[7][0] + rows[1][0] - 2 * v;
  const float xy = 0.25F * (rows[5][1] - rows[5][-1] - rows[3][1] + rows[3][-1]);
  const float xs = 0.25F * (rows[7][1] - rows[7][-1] - rows[1][1] + rows[1][-1]);
  const float ys = 0.25F * (rows[8][0] - rows[6][0] - rows[2][0] + rows[0][0]);

  const float c00 = yy * ss - ys * ys;
  const float c01 = xs * ys - xy * ss;
  const float c02 = xy * ys - yy * xs;
  const float c11 = xx * ss - xs * xs;
  const float c12 = xy * xs - xx * ys;
  const float c22 = xx * yy - xy * xy;
  const float scale = -1.0F / (xx * c00 + xy * c01 + xs * c02);

  Fit fit;
  fit.x = scale * (c00 * gx + c01 * gy + c02 * gs);
  fit.y = scale * (c01 * gx + c11 * gy + c12 * gs);
  fit.layer = scale * (c02 * gx + c12 * gy + c22 * gs);
  fit.value = v + 0.5F * (gx * fit.x + gy * fit.y + gs * fit.layer);
  const float trace = xx + yy;
  const float limit = (edge_threshold + 1) * (edge_threshold + 1);
  fit.edge = !(c22 > 0 && trace * trace * edge_threshold < limit * c22);
  return fit;
}

// The extremum of a parabola in x and y alone, in the plane `layer` layers above the sample's.
// There each of the nine values is that of a parabola along the layers. Nearer to the truth than
// Fit where the curvature changes from layer to layer; the same for what is a parabola in all
// three.
struct PlaneFit {
  float x, y;  // relative to the sample [samples]
};

HS_HOST_DEVICE inline PlaneFit fit_in_plane(const float* const* rows, float layer) {
  const auto at = [&](int row, int column) {
    const float below = rows[row][column];
    const float here = rows[3 + row][column];
    const float above = rows[6 + row][column];
    return here + 0.5F * layer * ((above - below) + layer * (above + below - 2 * here));
  };
  const float v = at(1, 0);
  const float gx = 0.5F * (at(1, 1) - at(1, -1));
  const float gy = 0.5F * (at(2, 0) - at(0, 0));
  const float xx = at(1, 1) + at(1, -1) - 2 * v;
  const float yy = at(2, 0) + at(0, 0) - 2 * v;
  const float xy = 0.25F * (at(2, 1) - at(2, -1) - at(0, 1) + at(0, -1));
  const float scale = -1.0F / (xx * yy - xy * xy);
  return {scale * (yy * gx - xy * gy), scale * (xx * gy - xy * gx)};
}

struct RefinedExtremum {
  int layer, y, x;             // the sample that the parabola was fitted at
  float to_layer, to_y, to_x;  // from there to the extremum [layers, samples]
  float response;              // |difference| [grey levels]
};

struct ExtremumLimits {
  int layers, height, width;  // of the octave
  float contrast_threshold;
  float edge_threshold;
};

// Where the extremum found at sample (layer, y, x) lies; false if it is none that is kept. While
// the parabola's extremum is nearer to another sample, it is fitted there, kMaxMoves times at most;
// a move is one sample along each axis, so no more than kMaxMoves + 1 samples around the first are
// read. `rows_at(layer, y, x, rows)` fills in a neighbourhood.
template <typename RowsAt>
HS_HOST_DEVICE inline bool refine_extremum(const RowsAt& rows_at, const ExtremumLimits& limits,
                                           int layer, int y, int x, RefinedExtremum* refined) {
  const float* rows[9];
  for (int move = 0; move <= kMaxMoves; ++move) {
    rows_at(layer, y, x, rows);
    const Fit fit = fit_extremum(rows, limits.edge_threshold);
    const float largest = fmaxf(fabsf(fit.layer), fmaxf(fabsf(fit.y), fabsf(fit.x)));
    if (largest <= kMaxOffset) {
      const float response = fabsf(fit.value);
      if (fit.edge || response < limits.contrast_threshold) return false;
      const PlaneFit place = fit_in_plane(rows, fit.layer);
      *refined = {layer, y, x, fit.layer, place.y, place.x, response};
      return fabsf(place.x) <= 1 && fabsf(place.y) <= 1;
    }
    const auto step = [](float offset) {
      return (offset > kMaxOffset ? 1 : 0) - (offset < -kMaxOffset ? 1 : 0);
    };
    layer += step(fit.layer);
    y += step(fit.y);
    x += step(fit.x);
    if (layer < 1 || layer > limits.layers) return false;
    if (y < kBorder || y >= limits.height - kBorder) return false;
    if (x < kBorder || x >= limits.width - kBorder) return false;
    if (step(fit.layer) == 0 && step(fit.y) == 0 && step(fit.x) == 0) return false;  // not finite
  }
  return false;
}

}  // namespace hybrid_slam::sift
