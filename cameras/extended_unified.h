#pragma once

#include <cmath>
#include <string_view>

#include "cameras/unified_projection.h"

namespace hybrid_slam {

// Wide lens after Khomutenko, Garcia and Martinet ("An Enhanced Unified Camera Model", RA-L 2016;
// Kalibr's eucm):
//   d = sqrt(beta (x^2 + y^2) + z^2), den = alpha d + (1 - alpha) z
//   u = fx x / den + cx,  v = fy y / den + cy
// Projects where the mapping is one-to-one: z > -w d, w = alpha / (1 - alpha) or its inverse,
// whichever is below 1.
struct ExtendedUnified {
  static constexpr std::string_view kName = "extended_unified";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 6;  // fx, fy, cx, cy [px], alpha, beta

  // [px] on the axis, the mean of both directions
  static double focal_length(const double* params) { return 0.5 * (params[0] + params[1]); }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    using std::sqrt;
    const T& x = point_in_cam[0];
    const T& y = point_in_cam[1];
    const T& z = point_in_cam[2];
    const T& alpha = params[4];
    const T d2 = params[5] * (x * x + y * y) + z * z;
    if (!(d2 > T(kMinDistance * kMinDistance))) return false;
    const T d = sqrt(d2);
    const T w = alpha <= T(0.5) ? alpha / (T(1) - alpha) : (T(1) - alpha) / alpha;
    if (!(z > -w * d)) return false;
    const T den = alpha * d + (T(1) - alpha) * z;
    if (!(den > T(0))) return false;
    pixel[0] = params[0] * x / den + params[2];
    pixel[1] = params[1] * y / den + params[3];
    return true;
  }

  // d_point: 2x3, d_params: 2x6 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params) {
    if (!project(params, point_in_cam, pixel)) return false;
    const auto [x, y, z] = std::array{point_in_cam[0], point_in_cam[1], point_in_cam[2]};
    const double alpha = params[4], beta = params[5];
    const double r2 = x * x + y * y;
    const double d = std::sqrt(beta * r2 + z * z);
    UnifiedDivision division;
    division.den = alpha * d + (1 - alpha) * z;
    division.den_by_point[0] = alpha * beta * x / d;
    division.den_by_point[1] = alpha * beta * y / d;
    division.den_by_point[2] = alpha * z / d + 1 - alpha;
    division.den_by_shape[0] = d - z;
    division.den_by_shape[1] = 0.5 * alpha * r2 / d;
    division.write<2>(params, point_in_cam, d_point, d_params);
    return true;
  }

  // The unit bearing of (u, v); false if the pixel lies beyond the model's range.
  static bool unproject(const double* params, const double* pixel, double* bearing) {
    const double alpha = params[4], beta = params[5];
    const double mx = (pixel[0] - params[2]) / params[0];
    const double my = (pixel[1] - params[3]) / params[1];
    const double r2 = mx * mx + my * my;
    const double root2 = 1 - (2 * alpha - 1) * beta * r2;
    if (!(root2 >= 0)) return false;
    const double mz = (1 - beta * alpha * alpha * r2) / (alpha * std::sqrt(root2) + 1 - alpha);
    return write_bearing(mx, my, mz, bearing);
  }

 private:
  static constexpr double kMinDistance = 1e-6;  // [m]
};

}  // namespace hybrid_slam
