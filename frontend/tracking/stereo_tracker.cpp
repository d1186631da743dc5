#include "frontend/tracking/stereo_tracker.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "frontend/tracking/stereo_keyframe.h"

namespace hybrid_slam {
namespace {

int count_valid(const std::vector<LandmarkId>& ids) {
  return static_cast<int>(
      std::count_if(ids.begin(), ids.end(), [](LandmarkId id) { return id.valid(); }));
}

std::vector<LandmarkId> valid_ids(const std::vector<LandmarkId>& ids) {
  std::vector<LandmarkId> valid;
  std::copy_if(ids.begin(), ids.end(), std::back_inserter(valid),
               [](LandmarkId id) { return id.valid(); });
  return valid;
}

void assign(const std::vector<ProjectionMatch>& matches, Frame& frame) {
  for (const ProjectionMatch& match : matches) {
    frame.landmarks[static_cast<std::size_t>(match.keypoint)] = match.landmark;
  }
}

void clear(Frame& frame) { frame.landmarks.assign(frame.size(), LandmarkId()); }

}  // namespace

std::string StereoTrackerOptions::validate() const {
  if (max_features < 1) {
    return "tracking: max_features must be positive";
  }
  for (const double value :
       {min_initial_share, close_baselines, last_frame_radius, local_map_radius}) {
    if (!(value > 0)) {
      return "tracking: min_initial_share, radii and close_baselines must be positive";
    }
  }
  if (!(last_frame_retry_share >= 0) || !(last_frame_min_share >= 0) || min_new_points < 0 ||
      min_reference_matches < 0 || min_pose_inliers < 6 || min_local_map_inliers < 6 ||
      min_odometer_inliers < 6) {
    return "tracking: shares and counts must not be negative, counts of inliers at least 6";
  }
  for (const std::string& error :
       {odometer.validate(), disparity.validate(), matcher.validate(), local_map.validate(),
        relocalization.validate(), keyframes.validate(), refinement.validate()}) {
    if (!error.empty()) {
      return error;
    }
  }
  return {};
}

StereoTracker::StereoTracker(CameraId camera_id, const Calibrated<RectifiedStereo>& camera,
                             const StereoTrackerOptions& options)
    : camera_id_(camera_id),
      stereo_(camera),
      camera_(camera),
      options_(options),
      odometer_(camera, options.odometer),
      disparity_(camera, options.disparity),
      refiner_(camera_id, camera, options.refinement) {
  const std::string error = options.validate();
  if (!error.empty()) {
    throw std::invalid_argument(error);
  }
}

TrackedFrame StereoTracker::track(Frame frame, const MapSnapshot& map, bool allow_keyframe) {
  if (!map.origin().valid()) {
    TrackedFrame result = initialize(frame);
    remember(std::move(frame), result);
    return result;
  }
  follow_map(map);
  correct_disparities(frame);
  TrackedFrame result;
  result.frame_index = frame.index;
  result.time = frame.time;
  result.disparity_offset = frame.u_right_correction;
  if (last_tracked_) {
    predict(frame, result);
    const Rigid3d predicted = frame.cam_from_world;
    if (!track_last_frame(frame, map, result)) {
      frame.cam_from_world = predicted;
      if (!track_reference(frame, map)) {
        frame.cam_from_world = predicted;
        clear(frame);
      }
    }
    if (track_local_map(frame, map, options_.min_local_map_inliers, result)) {
      result.source = PoseSource::kLocalMap;
    } else if (result.odometer_inliers >= options_.min_odometer_inliers) {
      frame.cam_from_world = predicted;
      result.source = PoseSource::kOdometer;
    }
  } else if (relocalize(frame, map, result)) {
    result.source = PoseSource::kRelocalization;
  }
  if (result.tracked()) {
    result.cam_from_world = frame.cam_from_world;
    result.reference = reference_;
    result.cam_from_reference = frame.cam_from_world * inverse(map.cam_from_world(reference_));
    if (allow_keyframe && !requested_keyframe_ && wants_keyframe(frame, map, result)) {
      result.keyframe = make_keyframe(frame);
    }
  }
  remember(std::move(frame), result);
  return result;
}

// The map has moved on since the last frame: a keyframe that was asked for may be in it, and the
// reference may have been corrected.
void StereoTracker::follow_map(const MapSnapshot& map) {
  if (!last_tracked_ || !last_) {
    return;
  }
  if (requested_keyframe_) {
    const Keyframe* keyframe = map.find_frame(camera_id_, *requested_keyframe_);
    if (keyframe != nullptr && last_->index == *requested_keyframe_) {
      reference_ = keyframe->id;
      last_->landmarks = keyframe->landmarks;
      last_from_reference_ = Rigid3d();
    }
    if (map.newest_frame_index() >= *requested_keyframe_) {
      requested_keyframe_.reset();
    }
  }
  if (reference_.valid()) {
    last_->cam_from_world = last_from_reference_ * map.cam_from_world(reference_);
  }
}

TrackedFrame StereoTracker::initialize(Frame& frame) const {
  TrackedFrame result;
  result.frame_index = frame.index;
  result.time = frame.time;
  const auto enough = static_cast<long>(options_.min_initial_share * options_.max_features);
  const auto& u_right = frame.features.u_right;
  const auto with_depth =
      std::count_if(u_right.begin(), u_right.end(), [](float u) { return !std::isnan(u); });
  if (static_cast<long>(frame.size()) < enough || with_depth < enough) {
    return result;
  }
  result.source = PoseSource::kInitialization;
  result.keyframe = make_keyframe(frame);
  return result;
}

void StereoTracker::correct_disparities(Frame& frame) const {
  frame.u_right_correction = disparity_.offset();
  for (float& u_right : frame.features.u_right) {
    u_right -= static_cast<float>(frame.u_right_correction);
  }
}

// Odometer and predicted pose; constant velocity, then the last pose, where the odometer fails.
void StereoTracker::predict(Frame& frame, TrackedFrame& result) {
  const auto motion = odometer_.estimate(last_->features, frame.features);
  if (motion) {
    result.prediction = Prediction::kOdometer;
    result.odometer_inliers = static_cast<int>(motion->inliers.size());
    frame.cam_from_world = motion->current_from_previous * last_->cam_from_world;
    disparity_.add(last_->features, last_->u_right_correction, frame.features,
                   frame.u_right_correction, *motion);
  } else if (velocity_) {
    result.prediction = Prediction::kConstantVelocity;
    frame.cam_from_world = *velocity_ * last_->cam_from_world;
  } else {
    result.prediction = Prediction::kLastPose;
    frame.cam_from_world = last_->cam_from_world;
  }
}

bool StereoTracker::track_last_frame(Frame& frame, const MapSnapshot& map,
                                     TrackedFrame& result) const {
  const std::vector<LandmarkId> ids = valid_ids(last_->landmarks);
  ProjectionMatcherOptions matcher = options_.matcher;
  const auto predictions =
      predict_landmarks(map, camera_, frame.cam_from_world, ids, matcher.max_view_angle_deg);
  matcher.radius = options_.last_frame_radius;
  auto matches = match_predictions(map, view_of(frame), predictions, nullptr, matcher);
  if (static_cast<int>(matches.size()) <
      share_of_features(frame, options_.last_frame_retry_share)) {
    matcher.radius *= 2;
    matches = match_predictions(map, view_of(frame), predictions, nullptr, matcher);
  }
  clear(frame);
  if (static_cast<int>(matches.size()) < share_of_features(frame, options_.last_frame_min_share)) {
    return false;
  }
  assign(matches, frame);
  result.last_frame_inliers = refine(frame, map);
  return result.last_frame_inliers >= options_.min_pose_inliers;
}

bool StereoTracker::track_reference(Frame& frame, const MapSnapshot& map) const {
  if (map.find(reference_) == nullptr) {
    return false;
  }
  frame.landmarks =
      match_keyframe(map, reference_, frame.features.left, options_.relocalization.ratio,
                     options_.relocalization.max_descriptor_distance);
  return count_valid(frame.landmarks) >= options_.min_reference_matches &&
         refine(frame, map) >= options_.min_pose_inliers;
}

bool StereoTracker::track_local_map(Frame& frame, const MapSnapshot& map, int min_inliers,
                                    TrackedFrame& result) {
  std::vector<LandmarkId> seeds = valid_ids(frame.landmarks);
  if (seeds.empty()) {
    seeds = valid_ids(last_->landmarks);
  }
  const LocalMap local = make_local_map(map, seeds, options_.local_map);
  if (!local.reference.valid()) {
    return false;
  }
  const auto predictions = predict_landmarks(map, camera_, frame.cam_from_world, local.landmarks,
                                             options_.matcher.max_view_angle_deg);
  std::vector<LandmarkId> matched = valid_ids(frame.landmarks);
  std::sort(matched.begin(), matched.end());
  std::vector<char> taken(frame.size(), 0);
  std::transform(frame.landmarks.begin(), frame.landmarks.end(), taken.begin(),
                 [](LandmarkId id) { return static_cast<char>(id.valid()); });
  std::vector<LandmarkPrediction> open;
  for (const LandmarkPrediction& prediction : predictions) {
    result.counts.visible.push_back(prediction.id);
    if (!std::binary_search(matched.begin(), matched.end(), prediction.id)) {
      open.push_back(prediction);
    }
  }
  ProjectionMatcherOptions matcher = options_.matcher;
  matcher.radius = options_.local_map_radius;
  assign(match_predictions(map, view_of(frame), open, &taken, matcher), frame);
  refine(frame, map);
  if (refiner_.refine(map, frame) > 0) {
    refine(frame, map);
  }
  result.inliers = count_valid(frame.landmarks);
  if (result.inliers < min_inliers) {
    result.counts = {};
    return false;
  }
  result.counts.found = valid_ids(frame.landmarks);
  reference_ = local.reference;
  return true;
}

bool StereoTracker::relocalize(Frame& frame, const MapSnapshot& map, TrackedFrame& result) {
  const auto found = hybrid_slam::relocalize(map, view_of(frame), options_.matcher, options_.pose,
                                             options_.relocalization);
  if (!found) {
    return false;
  }
  frame.cam_from_world = found->cam_from_world;
  frame.landmarks = found->landmarks;
  reference_ = found->keyframe;
  return track_local_map(frame, map, options_.relocalization.min_inliers, result);
}

// Optimises the frame's pose on the landmarks it has and drops those that disagree. Returns how
// many are left.
int StereoTracker::refine(Frame& frame, const MapSnapshot& map) const {
  std::vector<std::size_t> keypoint;
  const auto observations = pose_observations(map, frame.features.left, frame.features.u_right,
                                              frame.landmarks, keypoint);
  const auto refined = refine_pose(camera_, frame.cam_from_world, observations, options_.pose);
  std::vector<LandmarkId> kept(frame.size());
  for (std::size_t i = 0; i < keypoint.size(); ++i) {
    if (refined.inlier[i]) {
      kept[keypoint[i]] = frame.landmarks[keypoint[i]];
    }
  }
  frame.landmarks = std::move(kept);
  frame.cam_from_world = refined.cam_from_world;
  return refined.inliers;
}

bool StereoTracker::wants_keyframe(const Frame& frame, const MapSnapshot& map,
                                   const TrackedFrame& result) const {
  const auto coverage = stereo_coverage(camera_, frame, close_depth());
  if (!coverage) {
    return false;
  }
  KeyframeEvidence evidence;
  evidence.inliers = result.inliers;
  evidence.reference_landmarks = count_well_founded(map, reference_);
  evidence.close_tracked = coverage->close_tracked;
  evidence.close_untracked = coverage->close_untracked;
  evidence.frames_since_keyframe = static_cast<int>(frame.index - last_keyframe_frame_);
  evidence.keyframes = map.keyframe_count();
  evidence.motion = result.cam_from_reference.translation().norm() / coverage->median_depth;
  evidence.by_odometry = result.source == PoseSource::kOdometer;
  return needs_keyframe(evidence, options_.max_features, options_.keyframes);
}

NewKeyframe StereoTracker::make_keyframe(const Frame& frame) const {
  return make_stereo_keyframe(camera_id_, camera_, frame, reference_, close_depth(),
                              options_.min_new_points);
}

FeatureView StereoTracker::view_of(const Frame& frame) const {
  return {camera_, frame.features.left, frame.features.u_right, frame.grid};
}

int StereoTracker::share_of_features(const Frame& frame, double share) const {
  return static_cast<int>(
      share * std::min<double>(options_.max_features, static_cast<double>(frame.size())));
}

void StereoTracker::remember(Frame frame, const TrackedFrame& result) {
  velocity_.reset();
  if (result.tracked() && last_tracked_ && last_) {
    velocity_ = frame.cam_from_world * inverse(last_->cam_from_world);
  }
  if (result.keyframe) {
    requested_keyframe_ = frame.index;
    last_keyframe_frame_ = frame.index;
    refiner_.remember(frame);
  }
  last_from_reference_ = result.cam_from_reference;
  last_tracked_ = result.tracked();
  last_ = std::move(frame);
}

}  // namespace hybrid_slam
