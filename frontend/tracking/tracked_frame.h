#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "backend/map/map_edit.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

enum class PoseSource { kNone, kInitialization, kLocalMap, kOdometer, kRelocalization };
enum class Prediction { kNone, kOdometer, kConstantVelocity, kLastPose };

const char* to_string(PoseSource source);
const char* to_string(Prediction prediction);

// Landmarks of one frame, each once: those that it should show, and those that were found in it.
struct SeenLandmarks {
  std::vector<LandmarkId> visible;
  std::vector<LandmarkId> found;

  bool empty() const { return visible.empty() && found.empty(); }
};

// What tracking says of one frame.
struct TrackedFrame {
  std::int64_t frame_index = 0;
  double time = 0;  // [s]
  PoseSource source = PoseSource::kNone;
  Prediction prediction = Prediction::kNone;
  Rigid3d cam_from_world;       // as known at this moment
  KeyframeId reference;         // invalid for the frame that starts the map
  Rigid3d cam_from_reference;   // through which the frame follows later corrections
  double disparity_offset = 0;  // [px] found in the rectification and removed
  double shading = 0;           // that moving lamps pretend, removed; see ShadingCalibrator
  int odometer_inliers = 0;
  int last_frame_inliers = 0;
  int inliers = 0;  // landmarks that agree with the final pose

  std::optional<NewKeyframe> keyframe;  // set if the frame shall become one
  SeenLandmarks counts;

  bool tracked() const { return source != PoseSource::kNone; }
};

}  // namespace hybrid_slam
