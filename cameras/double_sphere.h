#pragma once

#include <cmath>
#include <string_view>

#include "cameras/unified_projection.h"

namespace hybrid_slam {

// Wide lens after Usenko, Demmel and Cremers ("The Double Sphere Camera Model", 3DV 2018; Kalibr's
// ds): two unit spheres, xi apart, then a pinhole shifted by alpha / (1 - alpha).
//   d1 = |P|, s = xi d1 + z, d2 = |(x, y, s)|, den = alpha d2 + (1 - alpha) s
//   u = fx x / den + cx,  v = fy y / den + cy
// Projects where the mapping is one-to-one: z > -w2 d1 (equations 43 to 45).
struct DoubleSphere {
  static constexpr std::string_view kName = "double_sphere";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 6;  // fx, fy, cx, cy [px], xi, alpha

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
    const T d1 = sqrt(x * x + y * y + z * z);
    if (!(d1 > T(kMinDistance)) || !(z > -limit(params) * d1)) return false;
    const T s = params[4] * d1 + z;
    const T d2 = sqrt(x * x + y * y + s * s);
    const T den = params[5] * d2 + (T(1) - params[5]) * s;
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
    const double xi = params[4], alpha = params[5];
    const double d1 = std::sqrt(x * x + y * y + z * z);
    const double s = xi * d1 + z;
    const double d2 = std::sqrt(x * x + y * y + s * s);
    const double by_s = alpha * s / d2 + 1 - alpha;  // d den / d s
    UnifiedDivision division;
    division.den = alpha * d2 + (1 - alpha) * s;
    division.den_by_point[0] = alpha * x / d2 + by_s * xi * x / d1;
    division.den_by_point[1] = alpha * y / d2 + by_s * xi * y / d1;
    division.den_by_point[2] = by_s * (xi * z / d1 + 1);
    division.den_by_shape[0] = by_s * d1;
    division.den_by_shape[1] = d2 - s;
    division.write<2>(params, point_in_cam, d_point, d_params);
    return true;
  }

  // The unit bearing of (u, v); false if the pixel lies beyond the model's range.
  static bool unproject(const double* params, const double* pixel, double* bearing) {
    const double xi = params[4], alpha = params[5];
    const double mx = (pixel[0] - params[2]) / params[0];
    const double my = (pixel[1] - params[3]) / params[1];
    const double r2 = mx * mx + my * my;
    const double root2 = 1 - (2 * alpha - 1) * r2;
    if (!(root2 >= 0)) return false;
    const double mz = (1 - alpha * alpha * r2) / (alpha * std::sqrt(root2) + 1 - alpha);
    const double under = mz * mz + (1 - xi * xi) * r2;
    if (!(under >= 0)) return false;
    const double k = (mz * xi + std::sqrt(under)) / (mz * mz + r2);
    return write_bearing(k * mx, k * my, k * mz - xi, bearing);
  }

 private:
  static constexpr double kMinDistance = 1e-6;  // [m]

  // w2
  template <typename T>
  static T limit(const T* params) {
    using std::sqrt;
    const T& xi = params[4];
    const T& alpha = params[5];
    const T w1 = alpha <= T(0.5) ? alpha / (T(1) - alpha) : (T(1) - alpha) / alpha;
    return (w1 + xi) / sqrt(T(2) * w1 * xi + xi * xi + T(1));
  }
};

}  // namespace hybrid_slam
