#pragma once

#include <cmath>
#include <numbers>
#include <string_view>

namespace hybrid_slam {

// Fisheye after Kannala and Brandt (OpenCV's fisheye, Kalibr's pinhole-equidistant):
//   theta   = atan2(r, z), r = hypot(x, y)               angle to the optical axis
//   theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
//   u = fx theta_d x / r + cx,  v = fy theta_d y / r + cy
// Holds up to and beyond 90 degrees: projects every point whose angle lies below pi and within the
// range from the axis on over which theta_d grows (beyond it two rays would share a pixel).
struct KannalaBrandt {
  static constexpr std::string_view kName = "kannala_brandt";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 8;  // fx, fy, cx, cy [px], k1, k2, k3, k4

  static double focal_length(const double* params) { return 0.5 * (params[0] + params[1]); }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    using std::atan2;
    using std::sqrt;
    const T& x = point_in_cam[0];
    const T& y = point_in_cam[1];
    const T& z = point_in_cam[2];
    const T r2 = x * x + y * y;
    T theta_over_r;
    T theta2;
    if (z > T(0) && r2 < T(kNearAxis) * z * z) {  // sqrt has no derivative at 0
      const T q = r2 / (z * z);
      const T ratio = atan_ratio(q);
      theta_over_r = ratio / z;
      theta2 = q * ratio * ratio;
    } else {
      const T r = sqrt(r2);
      const T theta = atan2(r, z);
      theta_over_r = theta / r;
      theta2 = theta * theta;
    }
    if (!accepts(params, r2 + z * z, theta2)) return false;
    const T scale = theta_over_r * radial(params, theta2);
    pixel[0] = params[0] * (scale * x) + params[2];
    pixel[1] = params[1] * (scale * y) + params[3];
    return true;
  }

  // d_point: 2x3, d_params: 2x8 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params);

  // The unit bearing of (u, v); false if the pixel lies beyond the model's range.
  static bool unproject(const double* params, const double* pixel, double* bearing);

  // The angle [rad] up to which the model projects: where theta_d stops growing, at most kMaxAngle.
  static double max_angle(const double* params);

  static constexpr double kMaxAngle = std::numbers::pi - 1e-6;  // at pi, x / r is undefined

 private:
  static constexpr double kNearAxis = 1e-4;       // (r / z)^2 below which the series below is exact
  static constexpr double kMinDistance2 = 1e-12;  // [m^2]

  // atan(sqrt(q)) / sqrt(q) for q < kNearAxis.
  template <typename T>
  static T atan_ratio(const T& q) {
    return T(1) - q * (T(1.0 / 3) - q * (T(1.0 / 5) - q * (T(1.0 / 7) - q * T(1.0 / 9))));
  }

  // theta_d / theta.
  template <typename T>
  static T radial(const T* params, const T& theta2) {
    const T* k = params + 4;
    return T(1) + theta2 * (k[0] + theta2 * (k[1] + theta2 * (k[2] + theta2 * k[3])));
  }

  template <typename T>
  static double value_of(const T& x) {
    if constexpr (requires { x.a; }) {
      return x.a;
    } else {
      return x;
    }
  }

  template <typename T>
  static bool accepts(const T* params, const T& distance2, const T& theta2) {
    const double k[4] = {value_of(params[4]), value_of(params[5]), value_of(params[6]),
                         value_of(params[7])};
    return value_of(distance2) > kMinDistance2 && value_of(theta2) <= kMaxAngle * kMaxAngle &&
           grows_up_to(k, value_of(theta2));
  }

  // Whether d theta_d / d theta is positive from 0 to sqrt(theta2). The derivative is a quartic in
  // theta^2; where all its Bernstein coefficients over [0, theta2] are positive, so is it.
  static bool grows_up_to(const double* k, double theta2) {
    const double w = theta2;
    const double a1 = 3 * k[0] * w;
    const double a2 = 5 * k[1] * w * w;
    const double a3 = 7 * k[2] * w * w * w;
    const double a4 = 9 * k[3] * w * w * w * w;
    const double b[5] = {1, 1 + a1 / 4, 1 + a1 / 2 + a2 / 6, 1 + 0.75 * a1 + a2 / 2 + a3 / 4,
                         1 + a1 + a2 + a3 + a4};
    if (!(b[4] > 0)) return false;
    if (b[1] > 0 && b[2] > 0 && b[3] > 0) return true;
    return is_positive(b, kMaxSubdivisions);
  }

  static constexpr int kMaxSubdivisions = 20;
  static bool is_positive(const double* bernstein, int subdivisions_left);
};

}  // namespace hybrid_slam
