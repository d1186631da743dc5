#include "apps/slam/frame_tracking.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace hybrid_slam {

namespace {

std::int64_t next_frame_index(const MapSnapshot& map) {
  std::int64_t next = 0;
  for (std::uint32_t i = 0; i < map.camera_count(); ++i) {
    next = std::max(next, map.newest_frame_index(CameraId(i)) + 1);
  }
  return next;
}

StereoTrackerOptions stereo_options(const CameraRig& cameras, const SlamOptions& options) {
  StereoTrackerOptions stereo = options.tracking;
  if (cameras.fisheye) {
    stereo.keyframes.min_tracked_ratio =
        std::max(stereo.keyframes.min_tracked_ratio, options.fisheye.stereo_tracked_ratio);
  }
  return stereo;
}

TrackingState state_of(const TrackedFrame& tracked, const MapSnapshot& map) {
  switch (tracked.source) {
    case PoseSource::kInitialization:
      return map.origin().valid() ? TrackingState::kStarting : TrackingState::kMap;
    case PoseSource::kLocalMap:
      return TrackingState::kMap;
    case PoseSource::kOdometer:
      return TrackingState::kOdometry;
    case PoseSource::kRelocalization:
      return TrackingState::kRelocalised;
    case PoseSource::kCoasted:
    case PoseSource::kNone:
      break;
  }
  return map.origin().valid() ? TrackingState::kLost : TrackingState::kStarting;
}

}  // namespace

const char* to_string(MapChange change) {
  switch (change) {
    case MapChange::kKeyframe:
      return "keyframe";
    case MapChange::kLoop:
      return "loop closed";
    case MapChange::kFullBundle:
      return "all adjusted";
    case MapChange::kEnd:
      break;
  }
  return "end";
}

const char* to_string(TrackingState state) {
  switch (state) {
    case TrackingState::kStarting:
      return "starting";
    case TrackingState::kMap:
      return "map";
    case TrackingState::kOdometry:
      return "odometry";
    case TrackingState::kRelocalised:
      return "relocalised";
    case TrackingState::kLost:
      break;
  }
  return "lost";
}

FrameTracking::FrameTracking(const CameraRig& cameras, const SlamOptions& options,
                             const Vocabulary& vocabulary, bool localize, LocalMapping& mapping,
                             Observers& observers, StageTimes& times)
    : places_(std::make_shared<KeyframeDatabase>(vocabulary)),
      stereo_id_(mapping.camera_id(cameras.stereo)),
      stereo_(stereo_id_, cameras.stereo, stereo_options(cameras, options), places_,
              mapping.map().view().correction(stereo_id_)),
      observers_(observers),
      times_(times),
      localize_(localize),
      first_index_(next_frame_index(mapping.map().view())),
      diagnosis_(options.features, cameras.fisheye.has_value()),
      stereo_floor_(stereo_id_),
      lamps_(cameras.fisheye.has_value()) {
  rig_.rows = RowField(cameras.stereo.width, cameras.stereo.height);
  rig_.of_map = mapping.map().view().correction(stereo_id_);
  rig_.alignment = rig_.of_map.rows;
  if (localize_ && !mapping.map().view().origin().valid()) {
    throw std::logic_error("FrameTracking: nothing to localise in");
  }
  if (cameras.fisheye) {
    fisheye_.emplace(mapping.camera_id(*cameras.fisheye), *cameras.fisheye,
                     options.fisheye.tracking, places_);
    fisheye_floor_.emplace(mapping.camera_id(*cameras.fisheye));
  }
}

std::optional<MappingJob> FrameTracking::track(CameraFrame frame, const MapSnapshot& map,
                                               bool allow_keyframe) {
  FrameResult result;
  result.camera = frame.camera;
  result.time = frame.time;
  result.features = static_cast<int>(frame.frame.size());
  const auto& rights = frame.frame.features.right_of_left;
  result.stereo_matches =
      static_cast<int>(std::count_if(rights.begin(), rights.end(), [](int k) { return k >= 0; }));
  result.keyframes = map.keyframe_count();
  result.landmarks = map.landmark_count();
  result.mapping_behind = !allow_keyframe;
  result.causes = diagnosis_.look(frame);
  result.row_error = row_error(frame.frame.features);
  learn_calibration(frame);
  follow_calibration(frame, map);
  TrackedFrame tracked = track_by_camera(frame, map, allow_keyframe && !localize_);
  doubt_lamps(frame.camera, map, tracked);
  if (!localize_) counts_.add(tracked.counts);  // else no keyframe would take them
  result.index = tracked.frame_index;
  result.state = state_of(tracked, map);
  if (frame.camera == CameraKind::kFisheye) {
    if (tracked.tracked()) result.left_from_fisheye = left_from_fisheye(map);
  } else {
    if (const auto cause = Diagnosis::look_at_offset(tracked.disparity_offset)) {
      result.causes.push_back(*cause);
    }
    result.rig = findings(tracked);
  }
  const Keyframe* const reference_of_frame = map.find(tracked.reference);
  const bool begins = tracked.source == PoseSource::kInitialization;
  if (tracked.tracked() && reference_of_frame != nullptr && !begins) {
    result.component = reference_of_frame->component;
  }
  auto keyframe = std::exchange(tracked.keyframe, std::nullopt);
  const double offset = tracked.disparity_offset;
  tracked.counts.visible = {};
  result.tracked = std::move(tracked);
  observers_.frame(std::move(result));
  if (!keyframe) return std::nullopt;
  const KeyframeId reference = keyframe->reference;
  return MappingJob{frame.camera,
                    std::move(*keyframe),
                    reference.valid() ? map.cam_from_world(reference) : Rigid3d(),
                    counts_.take(),
                    offset,
                    correction()};
}

// What the pair itself shows, before anything is corrected by the map.
void FrameTracking::learn_calibration(const CameraFrame& frame) {
  if (frame.camera != CameraKind::kStereo) return;
  add_rows(frame.frame.features, rig_.rows);
  rig_.median_disparity = median_disparity(frame.frame.features.left, frame.frame.features.u_right);
  if (frame.evidence.images.empty()) return;  // features alone
  rig_.alignment.reset();
  if (frame.evidence.alignment) rig_.alignment = *frame.evidence.alignment;
  rig_.changed.rows = frame.evidence.alignment_changed;
}

// Raises the frame's standard deviations by what lies under them, where that is known.
void FrameTracking::follow_calibration(CameraFrame& frame, const MapSnapshot& map) {
  FloorFinder& finder =
      frame.camera == CameraKind::kStereo ? stereo_floor_ : fisheye_floor_.value();
  if (finder.follow(map)) {
    if (frame.camera == CameraKind::kStereo) {
      stereo_.use_floor(finder.floor());
    } else {
      fisheye_->use_floor(finder.floor());
    }
  }
  if (finder.floor()) finder.floor()->raise(frame.frame.features.left);
}

std::shared_ptr<const RigFindings> FrameTracking::findings(const TrackedFrame& tracked) {
  rig_.disparity_offset = tracked.disparity_offset;
  rig_.disparity_sigma = stereo_.disparity().sigma();
  rig_.disparity = stereo_.disparity().estimate().found();
  rig_.shading = stereo_.shading_estimate().found();
  rig_.changed.disparity = stereo_.disparity().estimate().contradicts_start();
  rig_.changed.shading = stereo_.shading_estimate().contradicts_start();
  return std::make_shared<const RigFindings>(rig_);
}

TrackingEnd FrameTracking::end() {
  TrackingEnd end{counts_.take(), stereo_id_, std::nullopt, rig_.disparity_offset};
  if (!localize_) end.correction = correction();
  return end;
}

// Of a calibrator that is turned off, what the map says stays.
RigCorrection FrameTracking::correction() const {
  RigCorrection known = rig_.of_map;
  known.rows = rig_.alignment;
  if (rig_.disparity) known.disparity = rig_.disparity;
  if (rig_.shading) known.shading = rig_.shading;
  return known;
}

// Where both cameras have a pose of this moment.
std::optional<UncertainMotion> FrameTracking::left_from_fisheye(const MapSnapshot& map) const {
  const UncertainPose* const left = stereo_.uncertain_pose();
  const UncertainPose* const fisheye = fisheye_->uncertain_pose();
  if (left == nullptr || fisheye == nullptr || left->frame_index != fisheye->frame_index) {
    return std::nullopt;
  }
  return relative_pose(map, *left, *fisheye);
}

// What the lamps pretend is the stereo pair's to know: the map, on which the fisheye rests, is
// made of its images.
void FrameTracking::doubt_lamps(CameraKind camera, const MapSnapshot& map, TrackedFrame& tracked) {
  const Eigen::Vector3d place = inverse(tracked.cam_from_world).translation();
  if (tracked.tracked() && camera == CameraKind::kStereo) lamps_.vehicle_at(place);
  if (tracked.tracked() && camera == CameraKind::kFisheye) lamps_.arm_at(place);
  lamps_.widen(map, stereo_.shading_doubt(), tracked);
}

TrackedFrame FrameTracking::track_by_camera(CameraFrame& frame, const MapSnapshot& map,
                                            bool allow_keyframe) {
  StageClock clock(times_);
  places_->follow(map);
  frame.frame.index += first_index_;
  if (frame.camera == CameraKind::kStereo) {
    TrackedFrame tracked = stereo_.track(std::move(frame.frame), map, allow_keyframe);
    clock.lap("track");
    stereo_reference_ = tracked.reference;
    return tracked;
  }
  TrackedFrame tracked =
      fisheye_.value().track(std::move(frame.frame), map, stereo_reference_, allow_keyframe);
  clock.lap("track_fisheye");
  return tracked;
}

}  // namespace hybrid_slam
