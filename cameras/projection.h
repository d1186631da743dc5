#pragma once

#include <concepts>
#include <string_view>

namespace hybrid_slam {

// What a camera model is: a struct of static functions over raw parameters, templated on the scalar
// so that Ceres jets flow through. Camera axes: x right, y down, z forward [m]. Pixel origin: the
// centre of the first pixel is (0, 0). A measurement is (u, v), or (u_left, v, u_right) of a
// rectified pair. Matrices are row-major. See docs/adding_a_camera.md.
//
//   kName, kMeasurementDim, kParamCount
//   focal_length(params)  [px]; the mean where there are two
//   project<T>(params, point_in_cam, measurement)
//       False, and the measurement untouched, if the point cannot be projected.
//   project_with_jacobians(params, point_in_cam, measurement, d_point, d_params)
//       The same with d measurement / d point (kMeasurementDim x 3) and, unless null,
//       d measurement / d params (kMeasurementDim x kParamCount).
//   unproject(params, pixel, bearing)
//       The unit bearing of the pixel (u, v); false if no ray has this pixel.
template <typename M>
concept ProjectionModel = requires(const double* in, double* out) {
  { M::kName } -> std::convertible_to<std::string_view>;
  { M::kMeasurementDim } -> std::convertible_to<int>;
  { M::kParamCount } -> std::convertible_to<int>;
  { M::focal_length(in) } -> std::same_as<double>;
  { M::template project<double>(in, in, out) } -> std::same_as<bool>;
  { M::project_with_jacobians(in, in, out, out, out) } -> std::same_as<bool>;
  { M::unproject(in, in, out) } -> std::same_as<bool>;
};

}  // namespace hybrid_slam
