#pragma once

#include <string_view>

#include "cameras/distortion_inverse.h"
#include "cameras/pinhole.h"
#include "cameras/unified_projection.h"

namespace hybrid_slam {

// Pinhole with rational and tangential distortion (OpenCV's with eight coefficients, COLMAP's
// FULL_OPENCV; with k3 to k6 zero, OPENCV):
//   m = (x, y) / z, r = |m|, s = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
//   m' = s m + (2 p1 mx my + p2 (r^2 + 2 mx^2), p1 (r^2 + 2 my^2) + 2 p2 mx my)
//   u = fx m'x + cx,  v = fy m'y + cy
// Projects what lies in front of the camera (z > kMinDepth), also beyond the radius where the
// distortion folds, as bundle adjustment wants to pull such points back; unproject gives the ray
// that Newton's method finds from the axis' side.
struct Rational {
  static constexpr std::string_view kName = "rational";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 12;  // fx, fy, cx, cy [px], k1, k2, p1, p2, k3, k4, k5, k6

  static double focal_length(const double* params) { return 0.5 * (params[0] + params[1]); }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    if (!(point_in_cam[2] > T(kMinDepth))) return false;
    const T x = point_in_cam[0] / point_in_cam[2];
    const T y = point_in_cam[1] / point_in_cam[2];
    const T r2 = x * x + y * y;
    const T* k = params + 4;
    const T den = T(1) + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    if (!(den > T(0))) return false;
    const T s = (T(1) + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / den;
    pixel[0] = params[0] * (s * x + T(2) * k[2] * x * y + k[3] * (r2 + T(2) * x * x)) + params[2];
    pixel[1] = params[1] * (s * y + k[2] * (r2 + T(2) * y * y) + T(2) * k[3] * x * y) + params[3];
    return true;
  }

  // d_point: 2x3, d_params: 2x12 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params) {
    if (!project(params, point_in_cam, pixel)) return false;
    double m[2], m_by_point[6], distorted[2], by_m[4], by_k[16];
    divide_by_depth(point_in_cam, m, m_by_point);
    distort(params + 4, m, distorted, by_m, by_k);
    write_pixel_jacobians<kParamCount>(params, distorted, by_m, m_by_point, by_k, d_point,
                                       d_params);
    return true;
  }

  // The unit bearing of (u, v); false if there is no ray near.
  static bool unproject(const double* params, const double* pixel, double* bearing) {
    const double goal[2] = {(pixel[0] - params[2]) / params[0], (pixel[1] - params[3]) / params[1]};
    double m[2];
    const auto to_distorted = [&](const double* at, double* distorted, double* by_m) {
      double ignored[16];
      distort(params + 4, at, distorted, by_m, ignored);
    };
    return invert_distortion(to_distorted, goal, m) && write_bearing(m[0], m[1], 1, bearing);
  }

 private:
  // by_m: 2x2, by_k: 2x8, row-major.
  static void distort(const double* k, const double* m, double* distorted, double* by_m,
                      double* by_k) {
    const double x = m[0], y = m[1];
    const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
    const double den = 1 + k[5] * r2 + k[6] * r4 + k[7] * r6;
    const double s = (1 + k[0] * r2 + k[1] * r4 + k[4] * r6) / den;
    const double by_r2 =
        (k[0] + 2 * k[1] * r2 + 3 * k[4] * r4 - s * (k[5] + 2 * k[6] * r2 + 3 * k[7] * r4)) / den;
    distorted[0] = s * x + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x);
    distorted[1] = s * y + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y;
    by_m[0] = s + 2 * by_r2 * x * x;
    by_m[1] = by_m[2] = 2 * by_r2 * x * y;
    by_m[3] = s + 2 * by_r2 * y * y;
    add_tangential(k[2], k[3], m, by_m);
    for (int row = 0; row < 2; ++row) {
      double* const by = by_k + 8 * row;
      const double over = m[row] / den;
      by[0] = over * r2;
      by[1] = over * r4;
      by[2] = row == 0 ? 2 * x * y : r2 + 2 * y * y;
      by[3] = row == 0 ? r2 + 2 * x * x : 2 * x * y;
      by[4] = over * r6;
      by[5] = -s * over * r2;
      by[6] = -s * over * r4;
      by[7] = -s * over * r6;
    }
  }
};

}  // namespace hybrid_slam
