#pragma once

#include <cmath>
#include <string_view>

#include "cameras/radial.h"
#include "cameras/unified_projection.h"

namespace hybrid_slam {

// Wide lens after Mei and Rives ("Single View Point Omnidirectional Camera Calibration from Planar
// Grids", ICRA 2007; Kalibr's omni-radtan): the unit sphere seen from xi behind its centre, then
// radial and tangential distortion.
//   m = (x, y) / (z + xi |P|), r = |m|
//   m' = m (1 + k1 r^2 + k2 r^4) + (2 p1 mx my + p2 (r^2 + 2 mx^2), p1 (r^2 + 2 my^2) + 2 p2 mx my)
//   u = fx m'x + cx,  v = fy m'y + cy
// Projects where sphere and radial distortion are one-to-one: z > -|P| min(xi, 1 / xi), and r up to
// where the radial distortion stops growing.
struct UnifiedRadtan {
  static constexpr std::string_view kName = "unified_radtan";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 9;  // fx, fy, cx, cy [px], xi, k1, k2, p1, p2

  // [px] on the axis, the mean of both directions
  static double focal_length(const double* params) {
    return 0.5 * (params[0] + params[1]) / (1 + params[4]);
  }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    using std::sqrt;
    const T& x = point_in_cam[0];
    const T& y = point_in_cam[1];
    const T& z = point_in_cam[2];
    const T& xi = params[4];
    const T d = sqrt(x * x + y * y + z * z);
    const T w = xi <= T(1) ? xi : T(1) / xi;
    if (!(d > T(kMinDistance)) || !(z > -w * d)) return false;
    const T den = z + xi * d;
    if (!(den > T(0))) return false;
    const T mx = x / den;
    const T my = y / den;
    const T r2 = mx * mx + my * my;
    if (!grows_up_to(value_of(params[5]), value_of(params[6]), value_of(r2))) return false;
    const T* k = params + 5;
    const T radial = T(1) + r2 * (k[0] + r2 * k[1]);
    pixel[0] = params[0] * (mx * radial + T(2) * k[2] * mx * my + k[3] * (r2 + T(2) * mx * mx)) +
               params[2];
    pixel[1] = params[1] * (my * radial + k[2] * (r2 + T(2) * my * my) + T(2) * k[3] * mx * my) +
               params[3];
    return true;
  }

  // d_point: 2x3, d_params: 2x9 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params) {
    if (!project(params, point_in_cam, pixel)) return false;
    const auto [x, y, z] = std::array{point_in_cam[0], point_in_cam[1], point_in_cam[2]};
    const double d = std::sqrt(x * x + y * y + z * z);
    const double den = z + params[4] * d;
    const double m[2] = {x / den, y / den};
    double distorted[2], by_m[4];
    distort(params + 5, m, distorted, by_m);
    const double den_by[3] = {params[4] * x / d, params[4] * y / d, params[4] * z / d + 1};
    for (int row = 0; row < 2; ++row) {
      const double by_mx = params[row] * by_m[2 * row];
      const double by_my = params[row] * by_m[2 * row + 1];
      const double by_den = -(by_mx * m[0] + by_my * m[1]) / den;
      for (int i = 0; i < 3; ++i) d_point[3 * row + i] = by_den * den_by[i];
      d_point[3 * row] += by_mx / den;
      d_point[3 * row + 1] += by_my / den;
      if (d_params == nullptr) continue;
      double* const by = d_params + kParamCount * row;
      for (int i = 0; i < kParamCount; ++i) by[i] = 0;
      const double f = params[row];
      const double r2 = m[0] * m[0] + m[1] * m[1];
      by[row] = distorted[row];
      by[2 + row] = 1;
      by[4] = by_den * d;
      by[5] = f * m[row] * r2;
      by[6] = f * m[row] * r2 * r2;
      by[7 + row] = f * 2 * m[0] * m[1];
      by[8 - row] = f * (r2 + 2 * m[row] * m[row]);
    }
    return true;
  }

  // The unit bearing of (u, v); false if the pixel lies beyond the model's range. Newton's method
  // on the distortion, at most kMaxSteps steps.
  static bool unproject(const double* params, const double* pixel, double* bearing) {
    const double goal[2] = {(pixel[0] - params[2]) / params[0], (pixel[1] - params[3]) / params[1]};
    double m[2] = {goal[0], goal[1]};
    bool found = false;
    for (int i = 0; i < kMaxSteps && !found; ++i) {
      double distorted[2], j[4];
      distort(params + 5, m, distorted, j);
      const double ex = goal[0] - distorted[0], ey = goal[1] - distorted[1];
      const double determinant = j[0] * j[3] - j[1] * j[2];
      if (!(determinant > 0) || !std::isfinite(ex + ey)) return false;
      m[0] += (j[3] * ex - j[1] * ey) / determinant;
      m[1] += (j[0] * ey - j[2] * ex) / determinant;
      found = ex * ex + ey * ey < kSolved * (1 + goal[0] * goal[0] + goal[1] * goal[1]);
    }
    const double r2 = m[0] * m[0] + m[1] * m[1];
    const double xi = params[4];
    const double under = 1 + (1 - xi * xi) * r2;
    if (!found || !(under >= 0) || !grows_up_to(params[5], params[6], r2)) return false;
    const double scale = (xi + std::sqrt(under)) / (r2 + 1);
    return write_bearing(scale * m[0], scale * m[1], scale - xi, bearing);
  }

 private:
  static constexpr double kMinDistance = 1e-6;  // [m]
  static constexpr int kMaxSteps = 30;
  static constexpr double kSolved = 1e-26;  // squared, of the distorted point

  template <typename T>
  static double value_of(const T& x) {
    if constexpr (requires { x.a; }) {
      return x.a;
    } else {
      return x;
    }
  }

  static bool grows_up_to(double k1, double k2, double r2) {
    const double limit = RadialDistortion{k1, k2}.max_radius();
    return r2 < limit * limit;
  }

  // k: k1, k2, p1, p2. by_m: d distorted / d m, 2x2 row-major.
  static void distort(const double* k, const double* m, double* distorted, double* by_m) {
    const double x = m[0], y = m[1];
    const double r2 = x * x + y * y;
    const double radial = 1 + r2 * (k[0] + r2 * k[1]);
    const double d_radial = 2 * (k[0] + 2 * r2 * k[1]);  // by x, over x
    distorted[0] = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
    distorted[1] = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
    by_m[0] = radial + d_radial * x * x + 2 * k[2] * y + 6 * k[3] * x;
    by_m[1] = d_radial * x * y + 2 * k[2] * x + 2 * k[3] * y;
    by_m[2] = by_m[1];
    by_m[3] = radial + d_radial * y * y + 6 * k[2] * y + 2 * k[3] * x;
  }
};

}  // namespace hybrid_slam
