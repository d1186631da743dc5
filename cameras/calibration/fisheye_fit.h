#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>

#include "cameras/camera.h"

namespace hybrid_slam {

// A lens of another model as Kannala-Brandt, the model in which fisheye images are tracked.
struct FisheyeFit {
  Calibrated<KannalaBrandt> camera;
  double rms_px = 0;  // of the distances between the models' projections, all over the image
  double max_px = 0;
};

// Least squares over a grid of rays that the image shows, by Gauss-Newton. Rays beyond kMaxFitAngle
// from the axis are left out.
inline constexpr double kMaxFitAngle = 1.9;  // [rad]

template <ProjectionModel M>
FisheyeFit fit_kannala_brandt(const Calibrated<M>& lens) {
  constexpr int kGrid = 40;
  constexpr int kSteps = 30;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector2d>> rays;
  for (int i = 0; i <= kGrid; ++i) {
    for (int j = 0; j <= kGrid; ++j) {
      const Eigen::Vector2d pixel(i * (lens.width - 1.0) / kGrid, j * (lens.height - 1.0) / kGrid);
      Eigen::Vector3d bearing;
      if (!M::unproject(lens.params.data(), pixel.data(), bearing.data())) continue;
      if (std::acos(std::clamp(bearing.z(), -1.0, 1.0)) <= kMaxFitAngle) {
        rays.emplace_back(bearing, pixel);
      }
    }
  }
  FisheyeFit fit;
  fit.camera = {{M::focal_length(lens.params.data()), M::focal_length(lens.params.data()),
                 lens.params[2], lens.params[3], 0, 0, 0, 0},
                lens.width,
                lens.height};
  using Vector8d = Eigen::Matrix<double, 8, 1>;
  Eigen::Map<Vector8d> params(fit.camera.params.data());
  for (int step = 0; step < kSteps; ++step) {
    Eigen::Matrix<double, 8, 8> normal = 1e-9 * Eigen::Matrix<double, 8, 8>::Identity();
    Vector8d gradient = Vector8d::Zero();
    for (const auto& [bearing, pixel] : rays) {
      Eigen::Vector2d projected;
      Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
      Eigen::Matrix<double, 2, 8, Eigen::RowMajor> by_params;
      if (!KannalaBrandt::project_with_jacobians(params.data(), bearing.data(), projected.data(),
                                                 by_point.data(), by_params.data())) {
        continue;
      }
      normal += by_params.transpose() * by_params;
      gradient += by_params.transpose() * (projected - pixel);
    }
    const Vector8d change = normal.ldlt().solve(gradient);
    params -= change;
    if (change.cwiseAbs().maxCoeff() < 1e-10) break;
  }
  double sum = 0;
  for (const auto& [bearing, pixel] : rays) {
    Eigen::Vector2d projected;
    double error = HUGE_VAL;
    if (KannalaBrandt::project(params.data(), bearing.data(), projected.data())) {
      error = (projected - pixel).norm();
    }
    fit.max_px = std::max(fit.max_px, error);
    sum += error * error;
  }
  fit.rms_px = rays.empty() ? HUGE_VAL : std::sqrt(sum / static_cast<double>(rays.size()));
  if (rays.empty()) fit.max_px = HUGE_VAL;
  return fit;
}

}  // namespace hybrid_slam
