#pragma once

#include <array>
#include <optional>
#include <string_view>
#include <variant>

#include <Eigen/Core>

#include "cameras/bal.h"
#include "cameras/kannala_brandt.h"
#include "cameras/pinhole.h"
#include "cameras/projection.h"
#include "cameras/radial.h"
#include "cameras/rectified_stereo.h"

namespace hybrid_slam {

// A model with its numbers: the model's parameters and the size of its images [px].
template <ProjectionModel M>
struct Calibrated {
  using Model = M;
  std::array<double, M::kParamCount> params{};
  int width = 0;
  int height = 0;

  bool operator==(const Calibrated&) const = default;
};

// One of the models, chosen at run time. Visited when a residual is created or a batch is
// projected, never inside a model's own loop.
using Camera = std::variant<Calibrated<Pinhole>, Calibrated<RectifiedStereo>,
                            Calibrated<KannalaBrandt>, Calibrated<Radial>, Calibrated<Bal>>;

// Pixel (u, v) of a point (the left one of a stereo pair); none if it cannot be projected. May lie
// outside the image: see in_image.
std::optional<Eigen::Vector2d> project(const Camera& camera, const Eigen::Vector3d& point_in_cam);

// (u_left, v, u_right) of a point; none if it cannot be projected or the camera is no stereo pair.
std::optional<Eigen::Vector3d> project_stereo(const Camera& camera,
                                              const Eigen::Vector3d& point_in_cam);

// Unit bearing of a pixel; none if no ray has it.
std::optional<Eigen::Vector3d> unproject(const Camera& camera, const Eigen::Vector2d& pixel);

// Point in the left camera of a stereo measurement; none without positive disparity or a baseline.
std::optional<Eigen::Vector3d> triangulate_stereo(const Camera& camera,
                                                  const Eigen::Vector3d& measurement);

// Whether a pixel lies on the image: from -0.5 to size - 0.5, as pixel centres are integers.
bool in_image(const Camera& camera, const Eigen::Vector2d& pixel);

double focal_length(const Camera& camera);  // [px]; the mean where a model has two
double baseline(const Camera& camera);      // [m]; 0 unless it is a stereo pair
int image_width(const Camera& camera);      // [px]
int image_height(const Camera& camera);     // [px]
std::string_view model_name(const Camera& camera);

}  // namespace hybrid_slam
