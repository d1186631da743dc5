#pragma once

#include <array>
#include <string_view>

#include "cameras/kannala_brandt.h"

namespace hybrid_slam {

// Kannala-Brandt with one focal length and two coefficients (COLMAP's RADIAL_FISHEYE; with k2 zero,
// SIMPLE_RADIAL_FISHEYE). Range and behaviour are those of Kannala-Brandt.
struct RadialFisheye {
  static constexpr std::string_view kName = "radial_fisheye";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 5;  // f, cx, cy [px], k1, k2

  static double focal_length(const double* params) { return params[0]; }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    return KannalaBrandt::project(full(params).data(), point_in_cam, pixel);
  }

  // d_point: 2x3, d_params: 2x5 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params) {
    double by_full[16];
    if (!KannalaBrandt::project_with_jacobians(full(params).data(), point_in_cam, pixel, d_point,
                                               d_params == nullptr ? nullptr : by_full)) {
      return false;
    }
    for (int row = 0; row < 2 && d_params != nullptr; ++row) {
      const double* const from = by_full + 8 * row;
      double* const by = d_params + kParamCount * row;
      by[0] = from[0] + from[1];
      for (int i = 1; i < kParamCount; ++i) by[i] = from[i + 1];
    }
    return true;
  }

  // The unit bearing of (u, v); false if the pixel lies beyond the model's range.
  static bool unproject(const double* params, const double* pixel, double* bearing) {
    return KannalaBrandt::unproject(full(params).data(), pixel, bearing);
  }

 private:
  template <typename T>
  static std::array<T, 8> full(const T* params) {
    return {params[0], params[0], params[1], params[2], params[3], params[4], T(0), T(0)};
  }
};

}  // namespace hybrid_slam
