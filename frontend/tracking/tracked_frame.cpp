#include "frontend/tracking/tracked_frame.h"

namespace hybrid_slam {

const char* to_string(PoseSource source) {
  switch (source) {
    case PoseSource::kInitialization:
      return "initialization";
    case PoseSource::kLocalMap:
      return "local_map";
    case PoseSource::kOdometer:
      return "odometer";
    case PoseSource::kRelocalization:
      return "relocalization";
    case PoseSource::kCoasted:
      return "coasted";
    case PoseSource::kNone:
      break;
  }
  return "lost";
}

const char* to_string(Prediction prediction) {
  switch (prediction) {
    case Prediction::kOdometer:
      return "odometer";
    case Prediction::kLeftMatches:
      return "left_matches";
    case Prediction::kPatches:
      return "patches";
    case Prediction::kAcrossGap:
      return "across_gap";
    case Prediction::kConstantVelocity:
      return "constant_velocity";
    case Prediction::kLastPose:
      return "last_pose";
    case Prediction::kNone:
      break;
  }
  return "none";
}

}  // namespace hybrid_slam
