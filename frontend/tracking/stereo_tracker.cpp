#include "frontend/tracking/stereo_tracker.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "cameras/geometry/se3.h"
#include "frontend/tracking/stereo_keyframe.h"

namespace hybrid_slam {
namespace {

// Squared distance between the odometer's pose and the map's, in standard deviations, beyond which
// one of the two is wrong: chi2 of 6 degrees of freedom, one frame in a million.
constexpr double kMaxDisagreement = 38.3;

// Share of what the odometer finds again of the last frame, below which the map shows little.
constexpr double kFewLandmarks = 0.25;

int count_valid(const std::vector<LandmarkId>& ids) {
  return static_cast<int>(
      std::count_if(ids.begin(), ids.end(), [](LandmarkId id) { return id.valid(); }));
}

// Whether the motion from the last frame leads to where the map has the present one. The map's
// information is that of one pose; both have about the same.
bool agrees(const StereoMotion& motion, const Rigid3d& predicted, const Rigid3d& by_map,
            const Matrix6d& information) {
  const Vector6d off = se3_log(by_map * inverse(predicted));
  const Matrix6d covariance = motion.covariance + 2 * information.inverse();
  return off.dot(covariance.ldlt().solve(off)) <= kMaxDisagreement;
}

void clear(Frame& frame) { frame.landmarks.assign(frame.size(), LandmarkId()); }

}  // namespace

std::string StereoTrackerOptions::validate() const {
  for (const double value : {min_initial_share, close_baselines, last_frame_radius}) {
    if (!(value > 0)) {
      return "tracking: min_initial_share, last_frame_radius and close_baselines must be positive";
    }
  }
  if (!(last_frame_retry_share >= 0) || !(last_frame_min_share >= 0) || min_new_points < 0 ||
      min_reference_matches < 0 || min_pose_inliers < 6 || min_odometer_inliers < 6) {
    return "tracking: shares and counts must not be negative, counts of inliers at least 6";
  }
  for (const std::string& error :
       {TrackerOptions::validate(), odometer.validate(), disparity.validate()}) {
    if (!error.empty()) {
      return error;
    }
  }
  return {};
}

StereoTracker::StereoTracker(CameraId camera_id, const Calibrated<RectifiedStereo>& camera,
                             const StereoTrackerOptions& options,
                             std::shared_ptr<const KeyframeDatabase> places)
    : camera_id_(camera_id),
      camera_(camera),
      options_(options),
      odometer_(camera, options.odometer),
      disparity_(camera, options.disparity),
      matcher_(camera_id, camera, options, std::move(places)),
      last_(camera_id) {
  const std::string error = options.validate();
  if (!error.empty()) {
    throw std::invalid_argument(error);
  }
}

TrackedFrame StereoTracker::track(Frame frame, const MapSnapshot& map, bool allow_keyframe) {
  if (!map.origin().valid()) {
    TrackedFrame result = initialize(frame, map);
    uncertain_ = UncertainPose::of_keyframe(camera_id_, frame.index, KeyframeId());
    return remember(map, std::move(frame), std::move(result));
  }
  last_.follow(map);
  if (uncertain_) uncertain_ = present(map, *uncertain_);
  correct_disparities(frame);
  TrackedFrame result;
  result.frame_index = frame.index;
  result.time = frame.time;
  result.disparity_offset = frame.u_right_correction;
  result.shading = matcher_.shading();
  if (last_.tracked()) {
    const auto motion = predict(frame, result);
    const Rigid3d predicted = frame.cam_from_world;
    if (!track_last_frame(frame, map, result)) {
      frame.cam_from_world = predicted;
      if (!track_reference(frame, map)) {
        frame.cam_from_world = predicted;
        clear(frame);
      }
    }
    const auto information = track_local_map(frame, map, options_.min_local_map_inliers, result);
    const bool believed =
        motion && (!information || agrees(*motion, predicted, frame.cam_from_world, *information));
    chain_.add(believed ? motion : std::nullopt);
    if (information) {
      result.source = PoseSource::kLocalMap;
      std::vector<PoseObservation> others;
      if (motion && result.inliers < kFewLandmarks * result.odometer_inliers) {
        others = points_of_last_frame(*motion, frame);
        result.inliers = matcher_.refine(map, frame, others);
        result.counts.found = valid_ids(frame.landmarks);
      }
      uncertain_ =
          hybrid_slam::uncertain_pose(map, camera_, camera_id_, frame, result.reference,
                                      options_.pose, others, uncertain_ ? &*uncertain_ : nullptr);
    } else if (result.odometer_inliers >= options_.min_odometer_inliers) {
      frame.cam_from_world = predicted;
      matcher_.keep_agreeing(map, frame);
      result.reference = last_.reference();
      result.source = PoseSource::kOdometer;
      uncertain_ =
          moved(*uncertain_, {motion->current_from_previous, motion->covariance}, frame.index);
    }
  } else if (matcher_.relocalize(map, {}, frame) &&
             track_local_map(frame, map, options_.relocalization.min_inliers, result)) {
    result.source = PoseSource::kRelocalization;
    uncertain_ = hybrid_slam::uncertain_pose(map, camera_, camera_id_, frame, result.reference,
                                             options_.pose);
  } else if (options_.new_components && allow_keyframe && !last_.waits_for_keyframe()) {
    result.counts = {};
    begin_component(frame, map, result);
  }
  if (result.tracked()) {
    result.cam_from_world = frame.cam_from_world;
    result.cam_from_reference =
        frame.cam_from_world * inverse(map.cam_from_world(result.reference));
    write_covariance(map, *uncertain_, result);
    if (!result.keyframe && allow_keyframe && !last_.waits_for_keyframe() &&
        wants_keyframe(frame, map, result)) {
      result.keyframe = make_keyframe(frame, map, result.reference);
    }
  }
  return remember(map, std::move(frame), std::move(result));
}

TrackedFrame StereoTracker::initialize(Frame& frame, const MapSnapshot& map) const {
  TrackedFrame result;
  result.frame_index = frame.index;
  result.time = frame.time;
  if (!can_carry_map(frame)) return result;
  result.source = PoseSource::kInitialization;
  result.keyframe = make_keyframe(frame, map, KeyframeId());
  return result;
}

// Whether one pair shows enough to begin a map, or a component of it.
bool StereoTracker::can_carry_map(const Frame& frame) const {
  const auto enough = static_cast<long>(options_.min_initial_share * options_.max_features);
  const auto& u_right = frame.features.u_right;
  const auto with_depth =
      std::count_if(u_right.begin(), u_right.end(), [](float u) { return !std::isnan(u); });
  return static_cast<long>(frame.size()) >= enough && with_depth >= enough;
}

// Where the vehicle is against the map is not known: the frame gets the pose of the newest stereo
// keyframe, as good as any, and is held there by nothing.
bool StereoTracker::begin_component(Frame& frame, const MapSnapshot& map, TrackedFrame& result) {
  const Keyframe* const newest = map.newest_keyframe(camera_id_);
  if (newest == nullptr || !can_carry_map(frame)) return false;
  clear(frame);
  frame.cam_from_world = newest->cam_from_world;
  result.source = PoseSource::kInitialization;
  result.reference = newest->id;
  result.keyframe = make_stereo_keyframe(camera_id_, camera_, frame, newest->id, close_depth(),
                                         options_.min_new_points);
  Odometry odometry;
  odometry.previous = newest->id;
  odometry.motion = unknown_motion(Rigid3d());
  uncertain_ = moved(UncertainPose::of_keyframe(camera_id_, frame.index, newest->id),
                     odometry.motion, frame.index);
  result.keyframe->odometry = std::make_shared<const Odometry>(std::move(odometry));
  return true;
}

void StereoTracker::correct_disparities(Frame& frame) const {
  frame.u_right_correction = disparity_.offset();
  for (float& u_right : frame.features.u_right) {
    u_right -= static_cast<float>(frame.u_right_correction);
  }
}

// Odometer and predicted pose; constant velocity, then the last pose, where the odometer fails.
std::optional<StereoMotion> StereoTracker::predict(Frame& frame, TrackedFrame& result) {
  const Frame& last = last_.frame();
  auto motion = odometer_.estimate(last.features, frame.features);
  if (motion) {
    result.prediction = Prediction::kOdometer;
    result.odometer_inliers = static_cast<int>(motion->inliers.size());
    frame.cam_from_world = motion->current_from_previous * last.cam_from_world;
    disparity_.add(last.features, last.u_right_correction, frame.features, frame.u_right_correction,
                   *motion);
  } else if (last_.velocity()) {
    result.prediction = Prediction::kConstantVelocity;
    frame.cam_from_world = *last_.velocity() * last.cam_from_world;
  } else {
    result.prediction = Prediction::kLastPose;
    frame.cam_from_world = last.cam_from_world;
  }
  return motion;
}

// Where the map shows little, as it does where mapping lags behind or at its border, few landmarks
// along an edge of the image leave the pose loose: turned and shifted at once. What the last frame
// saw by itself holds it (the temporal points of ORB-SLAM2). Those that are no landmarks.
std::vector<PoseObservation> StereoTracker::points_of_last_frame(const StereoMotion& motion,
                                                                 const Frame& frame) const {
  const Frame& last = last_.frame();
  const Rigid3d world_from_last = inverse(last.cam_from_world);
  std::vector<PoseObservation> points;
  for (const CircularMatch& match : motion.inliers) {
    const auto i = static_cast<std::size_t>(match.previous);
    const auto j = static_cast<std::size_t>(match.current);
    const Keypoint& before = last.features.left.keypoints[i];
    const Keypoint& now = frame.features.left.keypoints[j];
    const auto point = triangulate_stereo(camera_, {before.x, before.y, last.features.u_right[i]});
    if (!point || frame.landmarks[j].valid()) continue;
    points.push_back(
        {world_from_last * *point,
         {now.x, now.y, frame.features.u_right[j]},
         std::hypot(static_cast<double>(before.sigma), static_cast<double>(now.sigma))});
  }
  return points;
}

bool StereoTracker::track_last_frame(Frame& frame, const MapSnapshot& map,
                                     TrackedFrame& result) const {
  const std::vector<LandmarkId> ids = valid_ids(last_.frame().landmarks);
  const double radius = options_.last_frame_radius;
  int matched = matcher_.match_projections(map, ids, radius, frame);
  if (matched < share_of_features(frame, options_.last_frame_retry_share)) {
    matched = matcher_.match_projections(map, ids, 2 * radius, frame);
  }
  if (matched < share_of_features(frame, options_.last_frame_min_share)) {
    clear(frame);
    return false;
  }
  result.last_frame_inliers = matcher_.refine(map, frame);
  return result.last_frame_inliers >= options_.min_pose_inliers;
}

bool StereoTracker::track_reference(Frame& frame, const MapSnapshot& map) const {
  if (map.find(last_.reference()) == nullptr) {
    return false;
  }
  frame.landmarks =
      match_keyframe(map, last_.reference(), frame.features.left, options_.relocalization.ratio,
                     options_.relocalization.max_descriptor_distance);
  return count_valid(frame.landmarks) >= options_.min_reference_matches &&
         matcher_.refine(map, frame) >= options_.min_pose_inliers;
}

// The information of the pose that was found; none if that is not believed.
std::optional<Matrix6d> StereoTracker::track_local_map(Frame& frame, const MapSnapshot& map,
                                                       int min_inliers,
                                                       TrackedFrame& result) const {
  std::vector<LandmarkId> seeds = valid_ids(frame.landmarks);
  if (seeds.empty()) {
    seeds = valid_ids(last_.frame().landmarks);
  }
  const Keyframe* reference = map.find(last_.reference());
  if (seeds.empty() && reference != nullptr) {
    seeds = valid_ids(reference->landmarks);
  }
  auto match = matcher_.match_local_map(map, seeds, min_inliers, frame);
  if (!match) {
    return std::nullopt;
  }
  result.reference = match->reference;
  result.inliers = match->inliers;
  result.counts = std::move(match->counts);
  return match->information;
}

bool StereoTracker::wants_keyframe(const Frame& frame, const MapSnapshot& map,
                                   const TrackedFrame& result) const {
  const auto coverage = stereo_coverage(camera_, frame, close_depth());
  if (!coverage) {
    return false;
  }
  KeyframeEvidence evidence;
  evidence.inliers = result.inliers;
  const ReferenceOverlap overlap = reference_overlap(map, result.reference, camera_, frame);
  evidence.reference_landmarks = overlap.landmarks;
  evidence.overlap = overlap.share();
  evidence.new_ground = overlap.new_ground();
  evidence.close_tracked = coverage->close_tracked;
  evidence.close_untracked = coverage->close_untracked;
  evidence.frames_since_keyframe = static_cast<int>(frame.index - last_.keyframe_frame());
  evidence.seconds_since_keyframe = frame.time - last_.keyframe_time();
  evidence.keyframes = map.keyframe_count();
  evidence.motion = result.cam_from_reference.translation().norm() / coverage->median_depth;
  evidence.by_odometry = result.source == PoseSource::kOdometer;
  return needs_keyframe(evidence, options_.max_features, options_.keyframes);
}

NewKeyframe StereoTracker::make_keyframe(const Frame& frame, const MapSnapshot& map,
                                         KeyframeId reference) const {
  NewKeyframe keyframe = make_stereo_keyframe(camera_id_, camera_, frame, reference, close_depth(),
                                              options_.min_new_points);
  const Keyframe* last = map.find_frame(camera_id_, last_.keyframe_frame());
  if (last != nullptr) keyframe.odometry = chain_.odometry(last->id);
  return keyframe;
}

int StereoTracker::share_of_features(const Frame& frame, double share) const {
  return static_cast<int>(
      share * std::min<double>(options_.max_features, static_cast<double>(frame.size())));
}

TrackedFrame StereoTracker::remember(const MapSnapshot& map, Frame frame, TrackedFrame result) {
  if (!last_.tracked()) chain_.add(std::nullopt);
  if (!result.tracked()) uncertain_.reset();
  if (result.tracked()) matcher_.learn_shading(map, frame);
  if (result.keyframe) {
    chain_.begin();
    matcher_.remember_keyframe(frame);
  }
  last_.remember(std::move(frame), result);
  return result;
}

}  // namespace hybrid_slam
