#include "cameras/kannala_brandt.h"

#include <algorithm>

namespace hybrid_slam {

bool KannalaBrandt::project_with_jacobians(const double* params, const double* point_in_cam,
                                           double* pixel, double* d_point, double* d_params) {
  const double x = point_in_cam[0];
  const double y = point_in_cam[1];
  const double z = point_in_cam[2];
  const double* k = params + 4;
  const double r2 = x * x + y * y;
  const double distance2 = r2 + z * z;
  // With s = theta_d / r: u = fx s x + cx. Needed besides s: ds_dz and g = (ds / dr) / r.
  double theta_over_r, theta2, s, ds_dz, g;
  if (z > 0 && r2 < kNearAxis * z * z) {
    const double q = r2 / (z * z);
    const double ratio = atan_ratio(q);
    const double d_ratio = -1.0 / 3 + q * (2.0 / 5 - q * (3.0 / 7 - q * 4.0 / 9));
    theta_over_r = ratio / z;
    theta2 = q * ratio * ratio;
    if (!accepts(params, distance2, theta2)) return false;
    const double radial_value = radial(params, theta2);
    const double d_radial = k[0] + theta2 * (2 * k[1] + theta2 * (3 * k[2] + theta2 * 4 * k[3]));
    s = theta_over_r * radial_value;
    g = 2 / (z * z * z) *
        (d_ratio * radial_value + ratio * d_radial * (ratio * ratio + 2 * q * ratio * d_ratio));
    ds_dz = -(radial_value + 2 * theta2 * d_radial) / distance2;
  } else {
    const double r = std::sqrt(r2);
    const double theta = std::atan2(r, z);
    theta_over_r = theta / r;
    theta2 = theta * theta;
    if (!accepts(params, distance2, theta2)) return false;
    const double d_theta_d =
        1 + theta2 * (3 * k[0] + theta2 * (5 * k[1] + theta2 * (7 * k[2] + theta2 * 9 * k[3])));
    s = theta_over_r * radial(params, theta2);
    g = (d_theta_d * z / distance2 - s) / r2;
    ds_dz = -d_theta_d / distance2;
  }
  const double fx = params[0];
  const double fy = params[1];
  pixel[0] = fx * (s * x) + params[2];
  pixel[1] = fy * (s * y) + params[3];
  d_point[0] = fx * (s + g * x * x);
  d_point[1] = fx * g * x * y;
  d_point[2] = fx * ds_dz * x;
  d_point[3] = fy * g * x * y;
  d_point[4] = fy * (s + g * y * y);
  d_point[5] = fy * ds_dz * y;
  if (d_params != nullptr) {
    std::fill(d_params, d_params + 16, 0.0);
    d_params[0] = s * x;
    d_params[2] = 1;
    d_params[9] = s * y;
    d_params[11] = 1;
    double power = theta_over_r;
    for (int i = 4; i < 8; ++i) {
      power *= theta2;
      d_params[i] = fx * x * power;
      d_params[8 + i] = fy * y * power;
    }
  }
  return true;
}

bool KannalaBrandt::is_positive(const double* bernstein, int subdivisions_left) {
  // The quartic lies within the hull of its coefficients and meets the first and the last one.
  if (!(bernstein[0] > 0) || !(bernstein[4] > 0)) return false;
  if (bernstein[1] > 0 && bernstein[2] > 0 && bernstein[3] > 0) return true;
  if (subdivisions_left == 0) return false;
  double left[5];
  double right[5];
  std::copy(bernstein, bernstein + 5, right);
  for (int i = 0; i < 5; ++i) {  // de Casteljau at the middle
    left[i] = right[0];
    for (int j = 0; j < 4 - i; ++j) right[j] = 0.5 * (right[j] + right[j + 1]);
  }
  // `right` now holds the second half's coefficients, first to last.
  return is_positive(left, subdivisions_left - 1) && is_positive(right, subdivisions_left - 1);
}

double KannalaBrandt::max_angle(const double* params) {
  const double* k = params + 4;
  double high = kMaxAngle * kMaxAngle;
  if (grows_up_to(k, high)) return kMaxAngle;
  double low = 0;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (grows_up_to(k, middle) ? low : high) = middle;
  }
  return std::sqrt(low);
}

bool KannalaBrandt::unproject(const double* params, const double* pixel, double* bearing) {
  const double x = (pixel[0] - params[2]) / params[0];
  const double y = (pixel[1] - params[3]) / params[1];
  const double theta_d = std::sqrt(x * x + y * y);
  const double* k = params + 4;
  double low = 0;
  double high = max_angle(params);
  if (!(theta_d <= high * radial(params, high * high))) return false;

  // Newton, kept inside a bracket that shrinks at every step: theta_d grows over [low, high].
  double theta = std::min(theta_d, high);
  constexpr int kMaxIterations = 100;
  for (int i = 0; i < kMaxIterations; ++i) {
    const double theta2 = theta * theta;
    const double error = theta * radial(params, theta2) - theta_d;
    (error > 0 ? high : low) = theta;
    const double slope =
        1 + theta2 * (3 * k[0] + theta2 * (5 * k[1] + theta2 * (7 * k[2] + theta2 * 9 * k[3])));
    double next = theta - error / slope;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const bool done = std::abs(next - theta) <= 1e-15 * (1 + theta);
    theta = next;
    if (done) break;
  }
  const double scale = theta_d > 1e-12 ? std::sin(theta) / theta_d : 1;
  bearing[0] = scale * x;
  bearing[1] = scale * y;
  bearing[2] = std::cos(theta);
  return true;
}

}  // namespace hybrid_slam
