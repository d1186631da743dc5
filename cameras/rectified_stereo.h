#pragma once

#include <string_view>

#include "cameras/pinhole.h"

namespace hybrid_slam {

// A rectified pair, seen as one camera whose frame is the left one's. Measurement:
// (u_left, v, u_right) with u_right = u_left - fx baseline / z; rows agree. The first four
// parameters are the pinhole's, so that a point without a right match is a measurement of Pinhole.
struct RectifiedStereo {
  static constexpr std::string_view kName = "rectified_stereo";
  static constexpr int kMeasurementDim = 3;
  static constexpr int kParamCount = 5;  // fx, fy, cx, cy [px], baseline [m]

  static double focal_length(const double* params) { return Pinhole::focal_length(params); }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* measurement) {
    if (!Pinhole::project(params, point_in_cam, measurement)) return false;
    measurement[2] = measurement[0] - params[0] * params[4] / point_in_cam[2];
    return true;
  }

  // d_point: 3x3, d_params: 3x5 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* measurement, double* d_point, double* d_params) {
    if (!Pinhole::project_with_jacobians(params, point_in_cam, measurement, d_point, nullptr)) {
      return false;
    }
    const double inverse_z = 1 / point_in_cam[2];
    const double disparity = params[0] * params[4] * inverse_z;
    measurement[2] = measurement[0] - disparity;
    d_point[6] = d_point[0];
    d_point[7] = 0;
    d_point[8] = d_point[2] + disparity * inverse_z;
    if (d_params != nullptr) {
      const double x = point_in_cam[0] * inverse_z;
      const double y = point_in_cam[1] * inverse_z;
      const double rows[15] = {x,
                               0,
                               1,
                               0,
                               0,  //
                               0,
                               y,
                               0,
                               1,
                               0,  //
                               x - params[4] * inverse_z,
                               0,
                               1,
                               0,
                               -params[0] * inverse_z};
      for (int i = 0; i < 15; ++i) d_params[i] = rows[i];
    }
    return true;
  }

  // The unit bearing of the left image's pixel (u, v).
  static bool unproject(const double* params, const double* pixel, double* bearing) {
    return Pinhole::unproject(params, pixel, bearing);
  }
};

// The left camera of a pair alone, over the pair's parameters: what a point without a right match
// measures when the pair's intrinsics are refined. The baseline has no effect on it.
struct LeftOfStereo {
  static constexpr std::string_view kName = "left_of_stereo";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = RectifiedStereo::kParamCount;

  static double focal_length(const double* params) { return Pinhole::focal_length(params); }

  template <typename T>
  static bool project(const T* params, const T* point_in_cam, T* pixel) {
    return Pinhole::project(params, point_in_cam, pixel);
  }

  // d_point: 2x3, d_params: 2x5 or null, both row-major.
  static bool project_with_jacobians(const double* params, const double* point_in_cam,
                                     double* pixel, double* d_point, double* d_params) {
    if (!Pinhole::project_with_jacobians(params, point_in_cam, pixel, d_point, nullptr)) {
      return false;
    }
    if (d_params != nullptr) {
      const double x = point_in_cam[0] / point_in_cam[2];
      const double y = point_in_cam[1] / point_in_cam[2];
      const double rows[10] = {x, 0, 1, 0, 0, 0, y, 0, 1, 0};
      for (int i = 0; i < 10; ++i) d_params[i] = rows[i];
    }
    return true;
  }

  static bool unproject(const double* params, const double* pixel, double* bearing) {
    return Pinhole::unproject(params, pixel, bearing);
  }
};

}  // namespace hybrid_slam
