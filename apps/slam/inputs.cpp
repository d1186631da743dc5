#include "apps/slam/inputs.h"

namespace hybrid_slam {

const char* to_string(CameraKind camera) {
  return camera == CameraKind::kStereo ? "stereo" : "fisheye";
}

Nanoseconds time_of(const SensorInput& input) {
  return std::visit([](const auto& one) { return one.time; }, input);
}

CameraKind camera_of(const SensorInput& input) {
  if (const auto* extracted = std::get_if<ExtractedFrame>(&input)) return extracted->camera;
  return std::holds_alternative<FisheyeImage>(input) ? CameraKind::kFisheye : CameraKind::kStereo;
}

}  // namespace hybrid_slam
