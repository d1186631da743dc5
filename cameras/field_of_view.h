#pragma once

#include <cmath>
#include <numbers>
#include <string_view>

#include "cameras/distortion_inverse.h"
#include "cameras/pinhole.h"
#include "cameras/unified_projection.h"

namespace hybrid_slam {

// Wide lens after Devernay and Faugeras ("Straight lines have to be straight", MVA 2001; COLMAP's
// FOV), with one angle w:
//   m = (x, y) / z, r = |m|, m' = m atan(2 r tan(w / 2)) / (r w)
//   u = fx m'x + cx,  v = fy m'y + cy
// Projects what lies in front of the camera (z > kMinDepth), where it is one-to-one.
struct FieldOfView {
  static constexpr std::string_view kName = "field_of_view";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 5;  // fx, fy, cx, cy [px], w [rad]

  static double focal_length(const double* params) { return 0.5 * (params[0] + params[1]); }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    if (!(point_in_cam[2] > T(kMinDepth))) return false;
    const T x = point_in_cam[0] / point_in_cam[2];
    const T y = point_in_cam[1] / point_in_cam[2];
    const T t = twice_tangent(params[4]);
    const T factor = over_angle(params[4], t) * atan_ratio((x * x + y * y) * t * t);
    pixel[0] = params[0] * factor * x + params[2];
    pixel[1] = params[1] * factor * y + params[3];
    return true;
  }

  // d_point: 2x3, d_params: 2x5 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params) {
    if (!project(params, point_in_cam, pixel)) return false;
    double m[2], m_by_point[6];
    divide_by_depth(point_in_cam, m, m_by_point);
    const double w = params[4], t = twice_tangent(w), scale = over_angle(w, t);
    const double r2 = m[0] * m[0] + m[1] * m[1], q = r2 * t * t;
    const double ratio = atan_ratio(q);
    // d ratio / d q
    const double slope = q < kSmall ? -1.0 / 3 + q * (2.0 / 5 - q * (3.0 / 7 - q * 4.0 / 9))
                                    : (1 / (1 + q) - ratio) / (2 * q);
    const double t_by_w = 1 + 0.25 * t * t;
    const double scale_by_w = w * w < kSmall ? w / 6 : (t_by_w - scale) / w;
    const double factor = scale * ratio;
    const double by_r2 = scale * slope * t * t;  // d factor / d r2
    const double factor_by_w = scale_by_w * ratio + scale * slope * 2 * r2 * t * t_by_w;
    const double distorted[2] = {factor * m[0], factor * m[1]};
    const double by_m[4] = {factor + 2 * by_r2 * m[0] * m[0], 2 * by_r2 * m[0] * m[1],
                            2 * by_r2 * m[0] * m[1], factor + 2 * by_r2 * m[1] * m[1]};
    const double by_k[2] = {factor_by_w * m[0], factor_by_w * m[1]};
    write_pixel_jacobians<kParamCount>(params, distorted, by_m, m_by_point, by_k, d_point,
                                       d_params);
    return true;
  }

  // The unit bearing of (u, v); false if the pixel lies beyond 90 degrees from the axis.
  static bool unproject(const double* params, const double* pixel, double* bearing) {
    const double x = (pixel[0] - params[2]) / params[0], y = (pixel[1] - params[3]) / params[1];
    const double w = params[4], t = twice_tangent(w);
    const double distorted = std::hypot(x, y);
    const double angle = distorted * (w * w < kSmall ? t : w);
    if (!(angle < std::numbers::pi / 2)) return false;
    const double factor = distorted > 0 && t != 0 ? std::tan(angle) / (distorted * t) : 1;
    return write_bearing(factor * x, factor * y, 1, bearing);
  }

 private:
  static constexpr double kSmall = 1e-4;  // squares below which the series below are exact

  template <typename T>
  static T twice_tangent(const T& w) {
    using std::tan;
    return T(2) * tan(T(0.5) * w);
  }

  // 2 tan(w / 2) / w
  template <typename T>
  static T over_angle(const T& w, const T& t) {
    if (w * w < T(kSmall)) return T(1) + w * w * (T(1.0 / 12) + w * w * T(1.0 / 120));
    return t / w;
  }

  // atan(sqrt(q)) / sqrt(q)
  template <typename T>
  static T atan_ratio(const T& q) {
    using std::atan;
    using std::sqrt;
    if (q < T(kSmall)) {
      return T(1) - q * (T(1.0 / 3) - q * (T(1.0 / 5) - q * (T(1.0 / 7) - q * T(1.0 / 9))));
    }
    const T root = sqrt(q);
    return atan(root) / root;
  }
};

}  // namespace hybrid_slam
