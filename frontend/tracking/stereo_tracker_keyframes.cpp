// What tracking gives to the map: keyframes, the first one, and the beginnings of components.
#include <algorithm>
#include <cmath>
#include <memory>
#include <unordered_map>
#include <utility>
#include <variant>

#include <Eigen/Cholesky>

#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"
#include "frontend/tracking/stereo_keyframe.h"
#include "frontend/tracking/stereo_tracker.h"

namespace hybrid_slam {
namespace {

bool has_right(const Frame& frame, std::size_t i) { return !std::isnan(frame.features.u_right[i]); }

// (u_left, v, u_right) before anything was subtracted.
Eigen::Vector3d measured(const Frame& frame, std::size_t i) {
  const Keypoint& left = frame.features.left.keypoints[i];
  return {left.x, left.y, frame.features.u_right[i] + frame.u_right_correction};
}

double variance(const Frame& frame, std::size_t i) {
  const double sigma = frame.features.left.keypoints[i].sigma;
  return sigma * sigma;
}

}  // namespace

TrackedFrame StereoTracker::initialize(Frame& frame, const MapSnapshot& map) const {
  TrackedFrame result;
  result.frame_index = frame.index;
  result.time = frame.time;
  if (!can_carry_map(frame)) return result;
  result.source = PoseSource::kInitialization;
  result.keyframe = make_keyframe(frame, map, KeyframeId());
  return result;
}

// Whether a frame shows enough to begin a map, or a component of it.
bool StereoTracker::can_carry_map(const Frame& frame) const {
  const auto enough = static_cast<long>(options_.min_initial_share * options_.max_features);
  const auto& u_right = frame.features.u_right;
  const auto with_depth =
      std::count_if(u_right.begin(), u_right.end(), [](float u) { return !std::isnan(u); });
  const bool many = static_cast<long>(frame.size()) >= enough && with_depth >= enough;
  return many || continues_untracked(frame);
}

// Few points carry a map, too, if they led from the frame before to this one: that they will lead
// to the next is as likely, and chance matches in the dark do not.
bool StereoTracker::continues_untracked(const Frame& frame) const {
  if (!untracked_) return false;
  const auto step = ladder_.climb(*untracked_, frame);
  return step && step->believed;
}

// Where the vehicle is against the map is not known: the frame gets the pose of the newest stereo
// keyframe, as good as any, and is held there by nothing.
void StereoTracker::begin_component(Frame& frame, const MapSnapshot& map, TrackedFrame& result) {
  const Keyframe* const newest = map.newest_keyframe(camera_id_);
  const auto coverage = stereo_coverage(camera_, frame, close_depth());
  if (newest == nullptr || !coverage || !can_carry_map(frame)) return;
  frame.landmarks.assign(frame.size(), LandmarkId());
  frame.cam_from_world = newest->cam_from_world;
  result.counts = {};
  result.source = PoseSource::kInitialization;
  result.prediction = Prediction::kNone;
  result.reference = newest->id;
  result.keyframe = make_stereo_keyframe(camera_id_, camera_, frame, newest->id, close_depth(),
                                         options_.min_new_points);
  Odometry odometry;
  odometry.previous = newest->id;
  odometry.motion = unknown_motion(Rigid3d());
  uncertain_ = moved(UncertainPose::of_keyframe(camera_id_, frame.index, newest->id),
                     odometry.motion, frame.index);
  depth_ = coverage->median_depth;
  result.keyframe->odometry = std::make_shared<const Odometry>(std::move(odometry));
}

// The odometer's motion, wherever it gave one. Where the map says something else one of the two is
// wrong, or the last frame was: the map jumps where known ground comes back into view. Then the
// motion counts as off by as much as that. Where it gave none the map's does, so that there is no
// keyframe that nothing holds: the map may not reach the next one.
void StereoTracker::lengthen_chain(const MapSnapshot& map, const Frame& frame,
                                   const Rigid3d& predicted, const std::optional<LadderStep>& step,
                                   bool agreed, const std::optional<UncertainPose>& last) {
  if (!step || !step->believed) {
    bridge_chain(map, last);
    return;
  }
  StereoMotion motion = step->motion;
  if (!agreed) {
    const Vector6d off = se3_log(frame.cam_from_world * inverse(predicted));
    motion.covariance += off * off.transpose();
  }
  chain_.add(motion);
}

// From the frame `last` to the present one, by the map. Between components nothing is known.
void StereoTracker::bridge_chain(const MapSnapshot& map, const std::optional<UncertainPose>& last) {
  const Keyframe* const before = last ? map.find(last->reference) : nullptr;
  const Keyframe* const now = map.find(uncertain_->reference);
  if (before == nullptr || now == nullptr || before->component != now->component) {
    chain_.add(std::nullopt);
    return;
  }
  const UncertainMotion motion = relative_pose(map, *uncertain_, *last);
  if (motion.covariance.llt().info() == Eigen::Success) {
    chain_.bridge(motion);
  } else {
    chain_.add(std::nullopt);
  }
}

// Of the disparities, which this run's keyframes tell of (DisparityCalibrator::follow). In a map of
// another run frames do: by the landmarks that two successive ones were matched with.
void StereoTracker::learn_offset(const Frame& frame, const MapSnapshot& map, KeyframeId reference) {
  const Keyframe* const seen = map.find(reference);
  if (seen == nullptr || seen->observations->disparity_offset || !last_.tracked()) return;
  const Frame& last = last_.frame();
  std::unordered_map<LandmarkId, std::size_t> in_last;
  for (std::size_t i = 0; i < last.size(); ++i) {
    if (last.landmarks[i].valid() && has_right(last, i)) in_last.emplace(last.landmarks[i], i);
  }
  std::vector<StereoSight> sights;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const auto before = in_last.find(frame.landmarks[i]);
    if (before == in_last.end() || !has_right(frame, i)) continue;
    const std::size_t j = before->second;
    sights.push_back(
        {measured(last, j), measured(frame, i), variance(last, j), variance(frame, i)});
  }
  disparity_.add(sights, frame.cam_from_world * inverse(last.cam_from_world));
}

void StereoTracker::learn_moving(const LadderStep& step, const Frame& frame) {
  const Frame& last = last_.frame();
  const auto& camera = std::get<Calibrated<RectifiedStereo>>(camera_);
  std::vector<CircularMatch> matches = step.motion.inliers;
  matches.insert(matches.end(), step.motion.outliers.begin(), step.motion.outliers.end());
  moving_.add(frame.time - last.time,
              followed_features(camera, last.features, frame.features, matches,
                                step.motion.current_from_previous));
}

// What no map shall be made of: it moves by itself. Empty where nothing does.
LeftOutKeypoints StereoTracker::moving(const Frame& frame) const {
  LeftOutKeypoints left_out;
  if (moving_.share() == 0) return left_out;
  for (const Keypoint& keypoint : frame.features.left.keypoints) {
    left_out.push_back(moving_.contains(keypoint.x, keypoint.y));
  }
  return left_out;
}

bool StereoTracker::wants_keyframe(const Frame& frame, const MapSnapshot& map,
                                   const TrackedFrame& result) const {
  const LeftOutKeypoints left_out = moving(frame);
  const auto coverage = stereo_coverage(camera_, frame, close_depth(), left_out);
  if (!coverage) {
    return false;
  }
  KeyframeEvidence evidence;
  evidence.inliers = result.inliers;
  const ReferenceOverlap overlap =
      reference_overlap(map, result.reference, camera_, frame, left_out);
  evidence.reference_landmarks = overlap.landmarks;
  evidence.overlap = overlap.share();
  evidence.new_ground = overlap.new_ground();
  evidence.close_tracked = coverage->close_tracked;
  evidence.close_untracked = coverage->close_untracked;
  evidence.frames_since_keyframe = static_cast<int>(frame.index - last_.keyframe_frame());
  evidence.seconds_since_keyframe = frame.time - last_.keyframe_time();
  evidence.keyframes = map.keyframe_count();
  evidence.motion = result.cam_from_reference.translation().norm() / coverage->median_depth;
  evidence.is_redundant =
      matcher_.is_redundant(map, frame, close_depth(), coverage->close_untracked);
  evidence.by_odometry = result.source == PoseSource::kOdometer;
  return needs_keyframe(evidence, options_.max_features, options_.keyframes);
}

NewKeyframe StereoTracker::make_keyframe(const Frame& frame, const MapSnapshot& map,
                                         KeyframeId reference) const {
  const LeftOutKeypoints left_out = moving(frame);
  NewKeyframe keyframe = make_stereo_keyframe(camera_id_, camera_, frame, reference, close_depth(),
                                              options_.min_new_points, left_out);
  const Keyframe* last = map.find_frame(camera_id_, last_.keyframe_frame());
  if (last != nullptr) keyframe.odometry = chain_.odometry(last->id);
  leave_out(left_out, keyframe);
  return keyframe;
}

}  // namespace hybrid_slam
