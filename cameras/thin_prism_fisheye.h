#pragma once

#include <array>
#include <cmath>
#include <numbers>
#include <string_view>

#include "cameras/distortion_inverse.h"
#include "cameras/kannala_brandt.h"
#include "cameras/unified_projection.h"

namespace hybrid_slam {

// Fisheye with radial, tangential and thin-prism distortion (COLMAP's THIN_PRISM_FISHEYE, after
// Weng et al., PAMI 1992):
//   m = theta (x, y) / hypot(x, y), r = |m| = theta, the angle to the axis
//   m' = m (1 + k1 r^2 + k2 r^4 + k3 r^6 + k4 r^8) + (s1 r^2, s2 r^2)
//        + (2 p1 mx my + p2 (r^2 + 2 mx^2), p1 (r^2 + 2 my^2) + 2 p2 mx my)
//   u = fx m'x + cx,  v = fy m'y + cy
// Projects every point but those behind on the axis; unproject gives the ray that Newton's method
// finds from the axis' side.
struct ThinPrismFisheye {
  static constexpr std::string_view kName = "thin_prism_fisheye";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 12;  // fx, fy, cx, cy [px], k1, k2, p1, p2, k3, k4, s1, s2

  static double focal_length(const double* params) { return 0.5 * (params[0] + params[1]); }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    T m[2];
    if (!KannalaBrandt::project(bare<T>().data(), point_in_cam, m)) return false;
    const T r2 = m[0] * m[0] + m[1] * m[1];
    const T* k = params + 4;
    const T s = T(1) + r2 * (k[0] + r2 * (k[1] + r2 * (k[4] + r2 * k[5])));
    const T xy = T(2) * m[0] * m[1];
    pixel[0] = params[0] * (s * m[0] + k[2] * xy + k[3] * (r2 + T(2) * m[0] * m[0]) + k[6] * r2) +
               params[2];
    pixel[1] = params[1] * (s * m[1] + k[2] * (r2 + T(2) * m[1] * m[1]) + k[3] * xy + k[7] * r2) +
               params[3];
    return true;
  }

  // d_point: 2x3, d_params: 2x12 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params) {
    double m[2], m_by_point[6], distorted[2], by_m[4], by_k[16];
    if (!KannalaBrandt::project_with_jacobians(bare<double>().data(), point_in_cam, m, m_by_point,
                                               nullptr)) {
      return false;
    }
    distort(params + 4, m, distorted, by_m, by_k);
    pixel[0] = params[0] * distorted[0] + params[2];
    pixel[1] = params[1] * distorted[1] + params[3];
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
    if (!invert_distortion(to_distorted, goal, m)) return false;
    return KannalaBrandt::unproject(bare<double>().data(), m, bearing);
  }

 private:
  // Kannala-Brandt that gives m.
  template <typename T>
  static std::array<T, 8> bare() {
    return {T(1), T(1), T(0), T(0), T(0), T(0), T(0), T(0)};
  }

  // by_m: 2x2, by_k: 2x8, row-major.
  static void distort(const double* k, const double* m, double* distorted, double* by_m,
                      double* by_k) {
    const double x = m[0], y = m[1];
    const double r2 = x * x + y * y;
    const double s = 1 + r2 * (k[0] + r2 * (k[1] + r2 * (k[4] + r2 * k[5])));
    const double by_r2 = k[0] + r2 * (2 * k[1] + r2 * (3 * k[4] + r2 * 4 * k[5]));
    distorted[0] = s * x + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x) + k[6] * r2;
    distorted[1] = s * y + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y + k[7] * r2;
    by_m[0] = s + 2 * by_r2 * x * x + 2 * k[6] * x;
    by_m[1] = 2 * by_r2 * x * y + 2 * k[6] * y;
    by_m[2] = 2 * by_r2 * x * y + 2 * k[7] * x;
    by_m[3] = s + 2 * by_r2 * y * y + 2 * k[7] * y;
    add_tangential(k[2], k[3], m, by_m);
    for (int row = 0; row < 2; ++row) {
      double* const by = by_k + 8 * row;
      by[0] = m[row] * r2;
      by[1] = by[0] * r2;
      by[2] = row == 0 ? 2 * x * y : r2 + 2 * y * y;
      by[3] = row == 0 ? r2 + 2 * x * x : 2 * x * y;
      by[4] = by[1] * r2;
      by[5] = by[4] * r2;
      by[6] = row == 0 ? r2 : 0;
      by[7] = row == 0 ? 0 : r2;
    }
  }
};

}  // namespace hybrid_slam
