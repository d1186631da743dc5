#include "cameras/radial.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cameras/bal.h"

namespace hybrid_slam {

double RadialDistortion::max_radius() const {
  // Smallest positive root of the derivative 1 + 3 k1 w + 5 k2 w^2, w = r^2.
  const double discriminant = 9 * k1 * k1 - 20 * k2;
  const double divisor = discriminant < 0 ? 0 : std::sqrt(discriminant) - 3 * k1;
  return divisor > 0 ? std::sqrt(2 / divisor) : std::numeric_limits<double>::infinity();
}

bool RadialDistortion::undistort(double distorted, double& r) const {
  const auto distort = [&](double x) { return x * (1 + x * x * (k1 + x * x * k2)); };
  if (!std::isfinite(distorted)) return false;
  double low = 0;
  double high = max_radius();
  if (std::isinf(high)) {
    high = std::max(1.0, distorted);
    while (distort(high) < distorted) high *= 2;
  } else if (!(distorted <= distort(high))) {
    return false;
  }

  // Newton, kept inside a bracket that shrinks at every step: the distortion grows over it.
  double x = std::min(distorted, high);
  constexpr int kMaxIterations = 100;
  for (int i = 0; i < kMaxIterations; ++i) {
    const double error = distort(x) - distorted;
    (error > 0 ? high : low) = x;
    const double slope = 1 + x * x * (3 * k1 + x * x * 5 * k2);
    double next = x - error / slope;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const bool done = std::abs(next - x) <= 1e-15 * x;
    x = next;
    if (done) break;
  }
  r = x;
  return true;
}

bool RadialDistortion::unproject(double distorted_x, double distorted_y, double* bearing) const {
  const double distorted = std::hypot(distorted_x, distorted_y);
  double r = 0;
  if (!undistort(distorted, r)) return false;
  const double scale = distorted > 0 ? r / distorted : 1;
  const double inverse_norm = 1 / std::hypot(r, 1.0);
  bearing[0] = distorted_x * scale * inverse_norm;
  bearing[1] = distorted_y * scale * inverse_norm;
  bearing[2] = inverse_norm;
  return true;
}

RadialProjection::RadialProjection(double f, double k1, double k2, const double* point_in_cam,
                                   double side) {
  const double inverse_depth = side / point_in_cam[2];
  const double n[2] = {point_in_cam[0] * inverse_depth, point_in_cam[1] * inverse_depth};
  const double r2 = n[0] * n[0] + n[1] * n[1];
  const double scale = 1 + r2 * (k1 + r2 * k2);
  const double d_scale = k1 + 2 * r2 * k2;  // by r2
  for (int i = 0; i < 2; ++i) {
    p[i] = f * scale * n[i];
    d_f[i] = scale * n[i];
    d_k1[i] = f * r2 * n[i];
    d_k2[i] = r2 * d_k1[i];
    double* row = d_point + 3 * i;
    for (int j = 0; j < 2; ++j) {
      row[j] = f * inverse_depth * ((i == j ? scale : 0) + 2 * d_scale * n[i] * n[j]);
    }
    row[2] = -side * (row[0] * n[0] + row[1] * n[1]);
  }
}

bool Radial::project_with_jacobians(const double* params, const double* point_in_cam, double* pixel,
                                    double* d_point, double* d_params) {
  if (!(point_in_cam[2] > kMinDepth)) return false;
  const RadialProjection r(params[0], params[3], params[4], point_in_cam, 1);
  std::copy(r.d_point, r.d_point + 6, d_point);
  for (int i = 0; i < 2; ++i) {
    pixel[i] = r.p[i] + params[1 + i];
    if (d_params == nullptr) continue;
    const double row[kParamCount] = {r.d_f[i], i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, r.d_k1[i],
                                     r.d_k2[i]};
    std::copy(row, row + kParamCount, d_params + kParamCount * i);
  }
  return true;
}

bool Radial::unproject(const double* params, const double* pixel, double* bearing) {
  return RadialDistortion{params[3], params[4]}.unproject(
      (pixel[0] - params[1]) / params[0], (pixel[1] - params[2]) / params[0], bearing);
}

bool Bal::project_with_jacobians(const double* params, const double* point_in_cam, double* pixel,
                                 double* d_point, double* d_params) {
  if (!(std::abs(point_in_cam[2]) > kMinDepth)) return false;
  const RadialProjection r(params[0], params[1], params[2], point_in_cam, -1);
  std::copy(r.d_point, r.d_point + 6, d_point);
  for (int i = 0; i < 2; ++i) {
    pixel[i] = r.p[i];
    if (d_params == nullptr) continue;
    const double row[kParamCount] = {r.d_f[i], r.d_k1[i], r.d_k2[i]};
    std::copy(row, row + kParamCount, d_params + kParamCount * i);
  }
  return true;
}

bool Bal::unproject(const double* params, const double* pixel, double* bearing) {
  if (!RadialDistortion{params[1], params[2]}.unproject(pixel[0] / params[0], pixel[1] / params[0],
                                                        bearing)) {
    return false;
  }
  bearing[2] = -bearing[2];
  return true;
}

}  // namespace hybrid_slam
