#include "apps/scene_renderer/lens.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cameras/geometry/so3.h"

namespace hybrid_slam {
namespace {

constexpr int kPortSteps = 30;  // of a fixed point that comes closer by a factor of 50 or more

}  // namespace

Lens::Lens(const Calibrated<Pinhole>& calibrated, const Miscalibration& errors)
    : camera_(calibrated), wrong_(errors != Miscalibration{}) {
  const auto& [fx, fy, cx, cy] = calibrated.params;
  focal_ = fx * (1 + errors.focal / 100);
  port_ = errors.flat_port / 1000;
  const double corner = std::hypot(std::max(cx, calibrated.width - 1 - cx),
                                   std::max(cy, calibrated.height - 1 - cy)) /
                        fx;
  k1_ = errors.distortion / 100 / (corner * corner);
}

// Where a ray of this slope in the water cuts the axis, from where one along the axis does. A ray
// of slope a in the air meets a port at distance d at d a from the axis, and its water ray comes
// from z = d - d a / slope; near the axis a / slope is the index.
std::optional<double> Lens::shift_at(double slope) const {
  if (port_ == 0 || slope < 1e-9) return 0;
  const double sine = kWaterIndex * slope / std::sqrt(1 + slope * slope);
  if (sine >= 1) return std::nullopt;
  return port_ * (kWaterIndex - sine / std::sqrt(1 - sine * sine) / slope);
}

std::optional<Eigen::Vector2d> Lens::project(const Eigen::Vector3d& point_in_cam) const {
  if (!wrong_) return hybrid_slam::project(camera_, point_in_cam);
  const auto& [fx, fy, cx, cy] = std::get<Calibrated<Pinhole>>(camera_).params;
  const double from_axis = point_in_cam.head<2>().norm(), z = point_in_cam.z();
  if (!(z > kMinDepth)) return std::nullopt;
  double slope = from_axis / z, shift = 0;
  for (int i = 0; i < (port_ > 0 ? kPortSteps : 0); ++i) {
    const auto next = shift_at(slope);
    if (!next) return std::nullopt;
    shift = *next;
    slope = from_axis / (z - shift);
  }
  // The pinhole's slope to where this ray is at the distance of the calibration.
  const double r = slope * (kPortCalibratedAt - shift) / kPortCalibratedAt;
  const double scale = from_axis > 0 ? r * (1 + k1_ * r * r) / from_axis : 0;
  return Eigen::Vector2d(focal_ * scale * point_in_cam.x() + cx,
                         focal_ * fy / fx * scale * point_in_cam.y() + cy);
}

std::optional<LensRay> Lens::unproject(const Eigen::Vector2d& pixel) const {
  if (!wrong_) {
    const auto bearing = hybrid_slam::unproject(camera_, pixel);
    return bearing ? std::optional<LensRay>({*bearing, 0}) : std::nullopt;
  }
  const auto& [fx, fy, cx, cy] = std::get<Calibrated<Pinhole>>(camera_).params;
  const Eigen::Vector2d distorted((pixel.x() - cx) / focal_, (pixel.y() - cy) / (focal_ * fy / fx));
  double r = 0;
  if (!RadialDistortion{k1_, 0}.undistort(distorted.norm(), r)) return std::nullopt;
  double slope = r, shift = 0;
  for (int i = 0; i < (port_ > 0 ? kPortSteps : 0); ++i) {
    const auto next = shift_at(slope);
    if (!next) return std::nullopt;
    shift = *next;
    slope = r * kPortCalibratedAt / (kPortCalibratedAt - shift);
  }
  const double scale = r > 0 ? slope / distorted.norm() : 0;
  return LensRay{Eigen::Vector3d(scale * distorted.x(), scale * distorted.y(), 1).normalized(),
                 shift};
}

Eigen::Quaterniond right_turn(const Miscalibration& errors) {
  const double degree = std::numbers::pi / 180;
  return so3_exp(degree * Eigen::Vector3d(errors.pitch, errors.yaw, errors.roll));
}

}  // namespace hybrid_slam
