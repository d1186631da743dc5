#pragma once

#include <cmath>
#include <string_view>

namespace hybrid_slam {

// Points nearer to the camera's plane than this [m] are not projected by the pinhole models.
inline constexpr double kMinDepth = 1e-6;

// u = fx x / z + cx, v = fy y / z + cy. Projects what lies in front of the camera (z > kMinDepth).
struct Pinhole {
  static constexpr std::string_view kName = "pinhole";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 4;  // fx, fy, cx, cy [px]

  static double focal_length(const double* params) { return 0.5 * (params[0] + params[1]); }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    if (!(point_in_cam[2] > T(kMinDepth))) return false;
    const T inverse_z = T(1) / point_in_cam[2];
    pixel[0] = params[0] * (point_in_cam[0] * inverse_z) + params[2];
    pixel[1] = params[1] * (point_in_cam[1] * inverse_z) + params[3];
    return true;
  }

  // d_point: 2x3, d_params: 2x4 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params) {
    if (!(point_in_cam[2] > kMinDepth)) return false;
    const double inverse_z = 1 / point_in_cam[2];
    const double x = point_in_cam[0] * inverse_z;
    const double y = point_in_cam[1] * inverse_z;
    pixel[0] = params[0] * x + params[2];
    pixel[1] = params[1] * y + params[3];
    d_point[0] = params[0] * inverse_z;
    d_point[1] = 0;
    d_point[2] = -d_point[0] * x;
    d_point[3] = 0;
    d_point[4] = params[1] * inverse_z;
    d_point[5] = -d_point[4] * y;
    if (d_params != nullptr) {
      const double rows[8] = {x, 0, 1, 0, 0, y, 0, 1};
      for (int i = 0; i < 8; ++i) d_params[i] = rows[i];
    }
    return true;
  }

  // The unit bearing of (u, v); every finite pixel has one.
  static bool unproject(const double* params, const double* pixel, double* bearing) {
    const double x = (pixel[0] - params[2]) / params[0];
    const double y = (pixel[1] - params[3]) / params[1];
    const double inverse_norm = 1 / std::sqrt(x * x + y * y + 1);
    if (!(inverse_norm > 0)) return false;
    bearing[0] = x * inverse_norm;
    bearing[1] = y * inverse_norm;
    bearing[2] = inverse_norm;
    return true;
  }
};

}  // namespace hybrid_slam
