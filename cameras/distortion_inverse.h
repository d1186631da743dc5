#pragma once

#include <cmath>

namespace hybrid_slam {

// Newton's method: the point m whose distorted place is `goal`, from m = goal, at most 30 steps.
// distort(m, distorted, by_m): by_m is the derivative, 2x2 row-major. False if there is none near.
template <typename Distort>
bool invert_distortion(const Distort& distort, const double* goal, double* m) {
  constexpr int kMaxSteps = 30;
  constexpr double kSolved = 1e-26;  // squared, by the goal's square
  m[0] = goal[0];
  m[1] = goal[1];
  for (int i = 0; i < kMaxSteps; ++i) {
    double distorted[2], j[4];
    distort(m, distorted, j);
    const double ex = goal[0] - distorted[0], ey = goal[1] - distorted[1];
    const double determinant = j[0] * j[3] - j[1] * j[2];
    if (!(determinant > 0) || !std::isfinite(ex + ey)) return false;
    if (ex * ex + ey * ey < kSolved * (1 + goal[0] * goal[0] + goal[1] * goal[1])) return true;
    m[0] += (j[3] * ex - j[1] * ey) / determinant;
    m[1] += (j[0] * ey - j[2] * ex) / determinant;
  }
  return false;
}

// What a distortion with tangential part adds to the derivative by m.
inline void add_tangential(double p1, double p2, const double* m, double* by_m) {
  const double x = m[0], y = m[1];
  by_m[0] += 2 * p1 * y + 6 * p2 * x;
  by_m[1] += 2 * p1 * x + 2 * p2 * y;
  by_m[2] += 2 * p1 * x + 2 * p2 * y;
  by_m[3] += 6 * p1 * y + 2 * p2 * x;
}

// pixel = K distorted: the derivatives by the point, 2x3, and by fx, fy, cx, cy and the kCount - 4
// coefficients (by_k: 2x(kCount - 4)), 2xkCount or null. All row-major.
template <int kCount>
void write_pixel_jacobians(const double* params, const double* distorted, const double* by_m,
                           const double* m_by_point, const double* by_k, double* d_point,
                           double* d_params) {
  for (int row = 0; row < 2; ++row) {
    for (int i = 0; i < 3; ++i) {
      d_point[3 * row + i] =
          params[row] * (by_m[2 * row] * m_by_point[i] + by_m[2 * row + 1] * m_by_point[3 + i]);
    }
    if (d_params == nullptr) continue;
    double* const by = d_params + kCount * row;
    for (int i = 0; i < 4; ++i) by[i] = 0;
    by[row] = distorted[row];
    by[2 + row] = 1;
    for (int i = 4; i < kCount; ++i) by[i] = params[row] * by_k[(kCount - 4) * row + i - 4];
  }
}

// (x, y) / z and its derivative by the point, 2x3 row-major.
inline void divide_by_depth(const double* point, double* m, double* m_by_point) {
  for (int row = 0; row < 2; ++row) {
    m[row] = point[row] / point[2];
    for (int i = 0; i < 2; ++i) m_by_point[3 * row + i] = i == row ? 1 / point[2] : 0;
    m_by_point[3 * row + 2] = -m[row] / point[2];
  }
}

}  // namespace hybrid_slam
