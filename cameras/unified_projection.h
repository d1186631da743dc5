#pragma once

#include <array>
#include <cmath>

namespace hybrid_slam {

// What the unified models of wide lenses share: (u, v) = (fx x, fy y) / den + (cx, cy), where den
// depends on the point and on parameters of shape. Its derivatives by both, and theirs.
struct UnifiedDivision {
  double den = 1;
  double den_by_point[3] = {};
  double den_by_shape[2] = {};

  // d_point: 2x3, d_params: 2x(4 + kShape) or null, row-major; params begin with fx, fy, cx, cy.
  template <int kShape>
  void write(const double* params, const double* point, double* d_point, double* d_params) const {
    constexpr int kCount = 4 + kShape;
    for (int row = 0; row < 2; ++row) {
      const double m = point[row] / den;
      for (int i = 0; i < 3; ++i) {
        d_point[3 * row + i] = params[row] * ((i == row ? 1 : 0) - m * den_by_point[i]) / den;
      }
      if (d_params == nullptr) continue;
      double* const by = d_params + kCount * row;
      for (int i = 0; i < kCount; ++i) by[i] = 0;
      by[row] = m;
      by[2 + row] = 1;
      for (int i = 0; i < kShape; ++i) by[4 + i] = -params[row] * m * den_by_shape[i] / den;
    }
  }
};

// False, and the bearing untouched, unless the direction is finite and not zero.
inline bool write_bearing(double x, double y, double z, double* bearing) {
  const double length = std::sqrt(x * x + y * y + z * z);
  if (!(length > 0) || !std::isfinite(length)) return false;
  bearing[0] = x / length;
  bearing[1] = y / length;
  bearing[2] = z / length;
  return true;
}

}  // namespace hybrid_slam
