#pragma once

#include <string_view>

#include "cameras/pinhole.h"

namespace hybrid_slam {

// r -> r (1 + k1 r^2 + k2 r^4): the distortion of Radial and Bal, over distances from the axis at
// depth 1. It grows up to max_radius; beyond, a distorted radius may belong to two rays.
struct RadialDistortion {
  double k1 = 0;
  double k2 = 0;

  double max_radius() const;  // infinite if it never stops growing

  // The r that `distorted` belongs to, at most max_radius; false if there is none.
  bool undistort(double distorted, double& r) const;

  // The unit bearing (x, y, z) of the distorted point at depth 1; false if it lies beyond.
  bool unproject(double distorted_x, double distorted_y, double* bearing) const;
};

// p = f (1 + k1 r^2 + k2 r^4) n with n = P.xy / (side P.z), r = |n|, and its derivatives,
// row-major: d_point 2x3, d_f, d_k1, d_k2 2 each. side: 1 or -1, the sign of z in front of the
// camera.
struct RadialProjection {
  double p[2], d_point[6], d_f[2], d_k1[2], d_k2[2];

  RadialProjection(double f, double k1, double k2, const double* point_in_cam, double side);
};

// One focal length and two coefficients of radial distortion (COLMAP's RADIAL):
//   (u, v) = f (1 + k1 r^2 + k2 r^4) (x, y) / z + (cx, cy),  r = hypot(x, y) / z
// Projects what lies in front of the camera (z > kMinDepth). Beyond the radius where the distortion
// stops growing it still evaluates, as bundle adjustment wants to pull such points back; unproject
// gives the ray within that radius.
struct Radial {
  static constexpr std::string_view kName = "radial";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 5;  // f, cx, cy [px], k1, k2

  static double focal_length(const double* params) { return params[0]; }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    if (!(point_in_cam[2] > T(kMinDepth))) return false;
    const T x = point_in_cam[0] / point_in_cam[2];
    const T y = point_in_cam[1] / point_in_cam[2];
    const T r2 = x * x + y * y;
    const T scale = params[0] * (T(1) + r2 * (params[3] + r2 * params[4]));
    pixel[0] = scale * x + params[1];
    pixel[1] = scale * y + params[2];
    return true;
  }

  // d_point: 2x3, d_params: 2x5 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params);

  // The unit bearing of (u, v); false if the pixel lies beyond the range of the distortion.
  static bool unproject(const double* params, const double* pixel, double* bearing);
};

}  // namespace hybrid_slam
