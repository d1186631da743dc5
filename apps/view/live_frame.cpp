#include "apps/view/live_frame.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "apps/slam/frame_figures.h"

namespace hybrid_slam {
namespace {

using Json = nlohmann::ordered_json;

Json or_null(double value) { return std::isfinite(value) ? Json(value) : Json(); }

void add_pose(const TrackedFrame& tracked, LiveFrame& live) {
  const PoseFigures figures = pose_figures(tracked);
  RunFrame& line = live.line;
  line.world_from_cam = figures.world_from_cam;
  line.sigma_position = figures.sigma_position;
  line.sigma_rotation = figures.sigma_rotation_deg;
  const Matrix6d& c = figures.covariance;
  line.covariance = {c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)};
  if (tracked.covariance_base.valid()) line.covariance_base = tracked.covariance_base;
  live.reference = tracked.reference;
  live.cam_from_reference = tracked.cam_from_reference;
}

}  // namespace

LiveFrame live_frame(const FrameResult& frame) {
  LiveFrame live;
  RunFrame& line = live.line;
  live.index = frame.index;
  line.stereo = frame.camera == CameraKind::kStereo;
  line.time = to_seconds(frame.time);
  line.state = to_string(frame.state);
  line.source = to_string(frame.tracked.source);
  line.prediction = to_string(frame.tracked.prediction);
  line.causes = causes_text(frame);
  line.features = frame.features;
  line.stereo_matches = frame.stereo_matches;
  line.inliers = frame.tracked.inliers;
  line.odometer = frame.tracked.odometer_inliers;
  if (frame.component.valid()) line.component = frame.component.value;
  line.row_error = frame.row_error.value_or(kUnknown);
  line.covariance.fill(kUnknown);
  live.keyframes = static_cast<double>(frame.keyframes);
  live.landmarks = static_cast<double>(frame.landmarks);
  if (frame.has_pose()) add_pose(frame.tracked, live);
  return live;
}

LiveFrame live_frame(const LeftOut& input) {
  LiveFrame live;
  live.line.stereo = input.camera == CameraKind::kStereo;
  live.line.time = to_seconds(input.time);
  live.line.state = input.reason;
  live.line.covariance.fill(kUnknown);
  return live;
}

void became_keyframe(const KeyframeResult& keyframe, std::vector<LiveFrame>& frames) {
  const auto same = std::find_if(frames.rbegin(), frames.rend(), [&](const LiveFrame& frame) {
    return frame.index == keyframe.index &&
           frame.line.stereo == (keyframe.camera == CameraKind::kStereo);
  });
  if (same == frames.rend()) return;
  same->reference = keyframe.id;
  same->cam_from_reference = Rigid3d();
}

Json frame_json(const LiveFrame& live) {
  const RunFrame& frame = live.line;
  Json json = {{"camera", frame.stereo ? 0 : 1},
               {"time", frame.time},
               {"state", frame.state},
               {"source", frame.source},
               {"prediction", frame.prediction},
               {"causes", frame.causes},
               {"features", or_null(frame.features)},
               {"stereo_matches", or_null(frame.stereo_matches)},
               {"inliers", or_null(frame.inliers)},
               {"odometer_inliers", or_null(frame.odometer)},
               {"sigma_position", or_null(frame.sigma_position)},
               {"sigma_rotation_deg", or_null(frame.sigma_rotation)},
               {"component", or_null(frame.component)},
               {"row_error_px", or_null(frame.row_error)},
               {"keyframes", or_null(live.keyframes)},
               {"landmarks", or_null(live.landmarks)}};
  if (frame.world_from_cam) {
    const auto& params = frame.world_from_cam->params;
    json["position"] = {params[4], params[5], params[6]};
    json["rotation"] = {params[0], params[1], params[2], params[3]};
  } else {
    json["position"] = json["rotation"] = Json();
  }
  return json;
}

RunStory live_story(const std::vector<LiveFrame>& frames, const MapSnapshot* map) {
  RunStory story;
  for (const LiveFrame& frame : frames) {
    story.frames.push_back(frame.line);
    const bool follows = frame.line.world_from_cam && frame.reference.valid() && map != nullptr &&
                         frame.reference < map->next_keyframe_id();
    if (!follows) continue;
    story.frames.back().world_from_cam =
        inverse(frame.cam_from_reference * map->cam_from_world(frame.reference));
  }
  complete_story(story);
  return story;
}

}  // namespace hybrid_slam
