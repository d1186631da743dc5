#pragma once

#include <cmath>
#include <string_view>

#include "cameras/radial.h"

namespace hybrid_slam {

// The camera of "Bundle Adjustment in the Large", by its own axes: x right, y up, z backward, and a
// measurement (u, v) from the image's centre, v up:
//   (u, v) = f (1 + k1 r^2 + k2 r^4) p,  p = -(x, y) / z,  r = |p|
// Looks along -z, but evaluates on either side (|z| > kMinDepth): the published problems hold
// observations of points that start behind their camera, and their costs count them. unproject
// gives the ray in front.
struct Bal {
  static constexpr std::string_view kName = "bal";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 3;  // f [px], k1, k2

  static double focal_length(const double* params) { return params[0]; }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    using std::abs;
    if (!(abs(point_in_cam[2]) > T(kMinDepth))) return false;
    const T x = -point_in_cam[0] / point_in_cam[2];
    const T y = -point_in_cam[1] / point_in_cam[2];
    const T r2 = x * x + y * y;
    const T scale = params[0] * (T(1) + r2 * (params[1] + r2 * params[2]));
    pixel[0] = scale * x;
    pixel[1] = scale * y;
    return true;
  }

  // d_point: 2x3, d_params: 2x3 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params);

  // The unit bearing of (u, v), with z < 0; false if it lies beyond the range of the distortion.
  static bool unproject(const double* params, const double* pixel, double* bearing);
};

}  // namespace hybrid_slam
