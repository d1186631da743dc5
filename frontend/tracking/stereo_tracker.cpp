#include "frontend/tracking/stereo_tracker.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Cholesky>

#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"

namespace hybrid_slam {
namespace {

// Squared distance between the odometer's pose and the map's, in standard deviations, beyond which
// one of the two is wrong: chi2 of 6 degrees of freedom, one frame in a million.
constexpr double kMaxDisagreement = 38.3;

constexpr double kMaxGap = 1;  // [s] since the last good frame, that is bridged

// Share of what the odometer finds again of the last frame, below which the map shows little.
constexpr double kFewLandmarks = 0.25;

// A pose that was coasted is of use as long as the camera sees most of what it says it sees: three
// sigma of its place are a third of the scene's distance.
constexpr double kMaxCoastedSigma = 0.11;

constexpr int kNearbyKeyframes = 5;  // of each kind, to find the frame in by descriptors

// Whether the motion from the last frame leads to where the map has the present one. The map's
// covariance is that of one pose; both have about the same.
bool agrees(const StereoMotion& motion, const Rigid3d& predicted, const Rigid3d& by_map,
            const Matrix6d& map_covariance) {
  const Vector6d off = se3_log(by_map * inverse(predicted));
  const Matrix6d covariance = motion.covariance + 2 * map_covariance;
  return squared_mahalanobis(off, covariance) <= kMaxDisagreement;
}

// The reference of the last tracked frame, those that share landmarks with it, and the newest.
std::vector<KeyframeId> nearby_keyframes(const MapSnapshot& map, KeyframeId reference) {
  std::vector<KeyframeId> ids;
  const auto add = [&](KeyframeId id) {
    if (std::find(ids.begin(), ids.end(), id) == ids.end()) ids.push_back(id);
  };
  if (map.find(reference) != nullptr) {
    add(reference);
    for (const Covisible& one : map.covisible(reference, 1, kNearbyKeyframes)) add(one.id);
  }
  for (const KeyframeId id : newest_keyframes(map, kNearbyKeyframes)) add(id);
  return ids;
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
                             std::shared_ptr<const KeyframeDatabase> places,
                             const RigCorrection& known)
    : camera_id_(camera_id),
      camera_(camera),
      options_(options),
      ladder_(camera, options.odometer),
      disparity_(camera_id, camera, options.disparity, known.disparity),
      matcher_(camera_id, camera, options, std::move(places), known.shading),
      moving_(camera.width, camera.height),
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
  disparity_.follow(map);
  correct_disparities(frame);
  TrackedFrame result;
  result.frame_index = frame.index;
  result.time = frame.time;
  result.disparity_offset = frame.u_right_correction;
  result.shading = matcher_.shading();
  if (last_.known() && follows_last(frame)) track_onwards(frame, map, result);
  if (!result.tracked()) relocalize(frame, map, result);
  if (!result.tracked() && last_.known()) coast(frame, map, result);
  const bool lost = !result.tracked() && !result.coasted();
  if (lost && options_.new_components && allow_keyframe && !last_.waits_for_keyframe()) {
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

// Long after the last good frame the vehicle may be anywhere, and the few points at the edge of
// both views say little of where: then places are recognised instead.
bool StereoTracker::follows_last(const Frame& frame) const {
  return last_.tracked() || frame.time - last_.frame().time <= kMaxGap;
}

// From the last tracked frame on: by the map where that holds, else by the motion since.
void StereoTracker::track_onwards(Frame& frame, const MapSnapshot& map, TrackedFrame& result) {
  const auto step = predict(frame, result);
  if (result.prediction == Prediction::kNone) return;
  const Rigid3d predicted = frame.cam_from_world;
  if (!track_last_frame(frame, map, result)) {
    frame.cam_from_world = predicted;
    if (!track_keyframes(frame, map)) {
      frame.cam_from_world = predicted;
      clear(frame);
    }
  }
  auto match = track_local_map(frame, map);
  if (match && step && is_contradicted(*step, predicted, frame, *match)) match.reset();
  const bool agreed =
      step && step->believed &&
      (!match || agrees(step->motion, predicted, frame.cam_from_world, match->support.covariance));
  const std::optional<UncertainPose> last = uncertain_;
  if (match) {
    result.source = PoseSource::kLocalMap;
    result.reference = match->reference;
    result.inliers = match->support.inliers;
    result.counts = std::move(match->counts);
    depth_ = match->support.depth;
    std::vector<PoseObservation> others;
    if (agreed && result.prediction != Prediction::kAcrossGap &&
        result.inliers < kFewLandmarks * result.odometer_inliers) {
      others = points_of_last_frame(step->motion, frame);
      result.inliers = matcher_.refine(map, match->search, frame, others).inliers;
      result.counts.found = valid_ids(frame.landmarks);
    }
    learn_offset(frame, map, result.reference);
    uncertain_ =
        hybrid_slam::uncertain_pose(map, camera_, camera_id_, frame, result.reference,
                                    options_.pose, others, uncertain_ ? &*uncertain_ : nullptr);
  } else if (agreed) {
    frame.cam_from_world = predicted;
    matcher_.keep_agreeing(map, frame);
    result.reference = last_.reference();
    result.source = PoseSource::kOdometer;
    depth_ = step->motion.support.depth;
    uncertain_ = moved(*uncertain_, {step->motion.current_from_previous, step->motion.covariance},
                       frame.index);
  }
  if (match || agreed) lengthen_chain(map, frame, predicted, step, agreed, last);
}

// Where the map and a motion that is believed say different things, one of them is wrong. The map
// is, where few of the landmarks hold that the frame should show with the points that moved.
bool StereoTracker::is_contradicted(const LadderStep& step, const Rigid3d& predicted,
                                    const Frame& frame,
                                    const MapMatcher::LocalMapMatch& match) const {
  return step.believed && match.support.inliers < kFewLandmarks * step.motion.support.inliers &&
         !agrees(step.motion, predicted, frame.cam_from_world, match.support.covariance);
}

void StereoTracker::relocalize(Frame& frame, const MapSnapshot& map, TrackedFrame& result) {
  clear(frame);
  std::vector<KeyframeId> nearby;  // where they were not tried before
  if (last_.known() && result.prediction == Prediction::kNone) {
    nearby = nearby_keyframes(map, last_.reference());
  }
  if (!matcher_.relocalize(map, nearby, frame)) return;
  auto match = track_local_map(frame, map);
  // Where the map looks like itself in several places, what is no accident may still be the wrong
  // one. Without much evidence another component is begun, which loops can join later.
  if (!match || match->support.inliers < options_.relocalization.min_inliers) return;
  result.source = PoseSource::kRelocalization;
  result.prediction = Prediction::kNone;
  result.reference = match->reference;
  result.inliers = match->support.inliers;
  result.counts = std::move(match->counts);
  depth_ = match->support.depth;
  const std::optional<UncertainPose> last = uncertain_;
  uncertain_ =
      hybrid_slam::uncertain_pose(map, camera_, camera_id_, frame, result.reference, options_.pose);
  bridge_chain(map, last);
}

// Goes on by itself: by the motion since a frame after the last good one, or at constant velocity.
void StereoTracker::coast(const Frame& frame, const MapSnapshot& map, TrackedFrame& result) {
  const auto step = across_gap(frame);
  std::optional<UncertainMotion> from_last = last_.constant_velocity(frame.time);
  if (step) from_last = {step->motion.current_from_previous, step->motion.covariance};
  if (!from_last) return;  // unplaced_ stays: the next frame may go on from there
  unplaced_ = {frame, *from_last};
  if (!(translation_sigma(from_last->covariance) <= kMaxCoastedSigma * depth_)) return;
  result.source = PoseSource::kCoasted;
  result.prediction = step ? Prediction::kAcrossGap : Prediction::kConstantVelocity;
  result.reference = last_.reference();
  result.cam_from_world = from_last->b_from_a * last_.frame().cam_from_world;
  result.cam_from_reference = result.cam_from_world * inverse(map.cam_from_world(result.reference));
  write_covariance(map, moved(*uncertain_, *from_last, frame.index), result);
}

// From the last tracked frame, by a frame between whose place was not known well enough.
std::optional<LadderStep> StereoTracker::across_gap(const Frame& frame) const {
  if (!unplaced_) return std::nullopt;
  auto step = ladder_.climb(unplaced_->frame, frame);
  if (!step || !step->believed) return std::nullopt;
  const UncertainMotion whole =
      UncertainMotion{step->motion.current_from_previous, step->motion.covariance} *
      unplaced_->from_last;
  step->motion.current_from_previous = whole.b_from_a;
  step->motion.covariance = whole.covariance;
  step->believed = is_certain(whole.covariance, step->motion.support.depth);
  step->rung = Prediction::kAcrossGap;
  return step;
}

void StereoTracker::correct_disparities(Frame& frame) const {
  frame.u_right_correction = disparity_.offset();
  for (float& u_right : frame.features.u_right) {
    u_right -= static_cast<float>(frame.u_right_correction);
  }
}

// The motion since the last tracked frame and the pose by it; constant velocity, then the last
// pose, where there is none.
std::optional<LadderStep> StereoTracker::predict(Frame& frame, TrackedFrame& result) {
  const Frame& last = last_.frame();
  auto step = ladder_.climb(last, frame);
  if (step && step->rung == Prediction::kOdometer && step->believed && options_.moving_regions) {
    learn_moving(*step, frame);
  }
  if (!step) step = across_gap(frame);
  if (step) {
    result.prediction = step->rung;
    result.odometer_inliers = step->motion.support.inliers;
    frame.cam_from_world = step->motion.current_from_previous * last.cam_from_world;
  } else if (const auto motion = last_.constant_velocity(frame.time)) {
    result.prediction = Prediction::kConstantVelocity;
    frame.cam_from_world = motion->b_from_a * last.cam_from_world;
  } else if (last_.tracked()) {
    result.prediction = Prediction::kLastPose;
    frame.cam_from_world = last.cam_from_world;
  }
  return step;
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
  const Rigid3d predicted = frame.cam_from_world;
  for (const double radius : {options_.last_frame_radius, 2 * options_.last_frame_radius}) {
    frame.cam_from_world = predicted;
    const auto search = matcher_.match_projections(map, ids, radius, frame);
    const PoseSupport support = matcher_.refine(map, search, frame);
    result.last_frame_inliers = support.inliers;
    if (is_no_accident(support)) return true;
  }
  clear(frame);
  return false;
}

bool StereoTracker::track_keyframes(Frame& frame, const MapSnapshot& map) const {
  return matcher_.relocalize_in(map, nearby_keyframes(map, last_.reference()), frame);
}

// None if the pose is not believed.
std::optional<MapMatcher::LocalMapMatch> StereoTracker::track_local_map(Frame& frame,
                                                                        const MapSnapshot& map) {
  std::vector<LandmarkId> seeds = valid_ids(frame.landmarks);
  if (seeds.empty() && last_.known()) {
    seeds = valid_ids(last_.frame().landmarks);
  }
  const Keyframe* reference = map.find(last_.reference());
  if (seeds.empty() && reference != nullptr) {
    seeds = valid_ids(reference->landmarks);
  }
  return matcher_.match_local_map(map, seeds, frame);
}

TrackedFrame StereoTracker::remember(const MapSnapshot& map, Frame frame, TrackedFrame result) {
  if (result.tracked()) {
    unplaced_.reset();
    matcher_.learn_shading(map, frame);
  }
  if (result.keyframe) {
    chain_.begin();
    matcher_.remember_keyframe(map, frame);
  }
  untracked_ = result.tracked() ? std::nullopt : std::optional(frame);
  last_.remember(std::move(frame), result);
  return result;
}

}  // namespace hybrid_slam
