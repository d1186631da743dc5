#pragma once

#include <optional>

#include <Eigen/Geometry>

#include "apps/scene_renderer/conditions.h"
#include "cameras/camera.h"

namespace hybrid_slam {

// A ray of a pixel in the water: it leaves the camera's axis at z = `shift`.
struct LensRay {
  Eigen::Vector3d bearing;  // unit
  double shift = 0;         // [m]
};

// How a camera truly sees: as its calibration says, or a stereo camera with the errors of a
// Miscalibration:
//  - focal lengths longer by a share;
//  - radial distortion r -> r (1 + k1 r^2) left in the image;
//  - a flat port (Treibitz et al., "Flat Refractive Geometry", PAMI 2012): rays bend where they
//    leave the air behind a thin port. All cut the axis, but not in one point. The image has been
//    warped so that the pinhole is right for points 1 m ahead, which is what a calibration in water
//    achieves; nearer and farther ones are off.
class Lens {
 public:
  Lens(const Camera& camera) : camera_(camera) {}  // NOLINT: a camera is its own lens
  template <ProjectionModel M>
  Lens(const Calibrated<M>& camera) : camera_(camera) {}  // NOLINT
  Lens(const Calibrated<Pinhole>& calibrated, const Miscalibration& errors);

  const Camera& calibrated() const { return camera_; }
  bool is_exact() const { return !wrong_; }
  bool has_port() const { return port_ > 0; }
  double true_focal() const { return focal_; }  // [px] along x; of a lens that is not exact
  double k1() const { return k1_; }

  // Pixel of a point in the camera's frame, may lie outside the image; none if it has none.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_in_cam) const;
  std::optional<LensRay> unproject(const Eigen::Vector2d& pixel) const;

 private:
  std::optional<double> shift_at(double slope) const;

  Camera camera_;
  bool wrong_ = false;
  double focal_ = 0, k1_ = 0, port_ = 0;  // [px], [], [m]
};

inline constexpr double kWaterIndex = 1.333;      // of refraction, to air
inline constexpr double kPortCalibratedAt = 1.0;  // [m]

// Turn of the right camera: nominal_from_true.
Eigen::Quaterniond right_turn(const Miscalibration& errors);

}  // namespace hybrid_slam
