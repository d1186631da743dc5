#include "apps/slam/frame_figures.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "cameras/geometry/uncertain_motion.h"

namespace hybrid_slam {

PoseFigures pose_figures(const TrackedFrame& frame) {
  constexpr double kDegreesPerRad = 180 / std::numbers::pi;
  const UncertainMotion world_from_cam =
      inverse(UncertainMotion{frame.cam_from_world, frame.covariance});
  PoseFigures figures;
  figures.world_from_cam = world_from_cam.b_from_a;
  figures.covariance = ros_covariance(world_from_cam);
  figures.sigma_position = std::sqrt(figures.covariance.topLeftCorner<3, 3>().trace());
  figures.sigma_rotation_deg =
      kDegreesPerRad * std::sqrt(figures.covariance.bottomRightCorner<3, 3>().trace());
  return figures;
}

std::string causes_text(const FrameResult& frame) {
  std::string text;
  for (const FoundCause& found : frame.causes) {
    text +=
        fmt::format("{}{}={:.4g}", text.empty() ? "" : ";", to_string(found.cause), found.value);
  }
  return text;
}

}  // namespace hybrid_slam
