#include "frontend/tracking/fisheye_tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <utility>

#include "frontend/tracking/stereo_keyframe.h"

namespace hybrid_slam {
namespace {

constexpr double kSigmas = 3;  // that a prediction may be off by

// Median distance of the landmarks that a frame shows [m]; infinite if there are none.
double median_distance(const MapSnapshot& map, const Frame& frame) {
  std::vector<double> distances;
  for (const LandmarkId id : frame.landmarks) {
    const Landmark* landmark = id.valid() ? map.find(id) : nullptr;
    if (landmark != nullptr) {
      distances.push_back((frame.cam_from_world * landmark->point_in_world).norm());
    }
  }
  if (distances.empty()) {
    return std::numeric_limits<double>::infinity();
  }
  const auto middle = distances.begin() + static_cast<long>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

}  // namespace

FisheyeTrackerOptions::FisheyeTrackerOptions() {
  keyframes.min_tracked_ratio = 0.5;
  relocalization.min_inliers = 30;
  // The stereo pair made most landmarks. What the fisheye's first view of one is off by is in all
  // that are aligned with it, so that more of them do not make the place more certain.
  refinement.sigma = 0.25;
}

std::string FisheyeTrackerOptions::validate() const {
  const std::string error = TrackerOptions::validate();
  return error.empty() ? error : "fisheye: " + error;
}

FisheyeTracker::FisheyeTracker(CameraId camera_id, const Calibrated<KannalaBrandt>& camera,
                               const FisheyeTrackerOptions& options,
                               std::shared_ptr<const KeyframeDatabase> places)
    : camera_id_(camera_id),
      camera_(camera),
      focal_(focal_length(camera_)),
      options_(options),
      matcher_(camera_id, camera, options, std::move(places)),
      last_(camera_id) {
  const std::string error = options.validate();
  if (!error.empty()) {
    throw std::invalid_argument(error);
  }
}

TrackedFrame FisheyeTracker::track(Frame frame, const MapSnapshot& map, KeyframeId stereo_reference,
                                   bool allow_keyframe) {
  last_.follow(map);
  uncertain_.reset();
  bool certain = false;
  TrackedFrame result;
  result.frame_index = frame.index;
  result.time = frame.time;
  if (matcher_.relocalize(map, candidates(map, stereo_reference), frame)) {
    auto match = matcher_.match_local_map(map, valid_ids(frame.landmarks), frame);
    if (match) {
      result.source = last_.tracked() ? PoseSource::kLocalMap : PoseSource::kRelocalization;
      result.cam_from_world = frame.cam_from_world;
      result.reference = match->reference;
      result.cam_from_reference =
          frame.cam_from_world * inverse(map.cam_from_world(match->reference));
      result.inliers = match->support.inliers;
      certain = is_certain(match->support);
      result.counts = std::move(match->counts);
      uncertain_ = hybrid_slam::uncertain_pose(map, camera_, camera_id_, frame, result.reference,
                                               options_.pose);
      write_covariance(map, *uncertain_, result);
    }
  }
  if (result.tracked() && allow_keyframe && !last_.waits_for_keyframe() && certain &&
      wants_keyframe(frame, map, result)) {
    result.keyframe = NewKeyframe{make_observations(camera_id_, frame),
                                  frame.cam_from_world,
                                  frame.landmarks,
                                  {},
                                  result.reference};
    matcher_.remember_keyframe(map, frame);
  }
  last_.remember(std::move(frame), result);
  return result;
}

std::vector<KeyframeId> FisheyeTracker::candidates(const MapSnapshot& map,
                                                   KeyframeId stereo_reference) const {
  std::vector<KeyframeId> keyframes;
  const auto add = [&](KeyframeId id) {
    if (map.find(id) != nullptr &&
        std::find(keyframes.begin(), keyframes.end(), id) == keyframes.end()) {
      keyframes.push_back(id);
    }
  };
  if (last_.tracked()) {
    add(last_.reference());
  }
  add(stereo_reference);
  return keyframes;
}

// Whether the place is known well enough for what a keyframe is used for: landmarks at the distance
// of those it shows are looked for within the local map's radius of where it predicts them. No
// odometer holds it if it is not.
bool FisheyeTracker::is_certain(const PoseSupport& support) const {
  const double at_radius = options_.local_map_radius * support.depth / focal_;
  return kSigmas * translation_sigma(support.covariance) <= at_radius;
}

bool FisheyeTracker::wants_keyframe(const Frame& frame, const MapSnapshot& map,
                                    const TrackedFrame& result) const {
  KeyframeEvidence evidence;
  evidence.inliers = result.inliers;
  evidence.reference_landmarks = count_well_founded(map, result.reference);
  evidence.close_tracked = options_.max_features;  // a single camera makes no close points
  evidence.frames_since_keyframe = static_cast<int>(frame.index - last_.keyframe_frame());
  evidence.seconds_since_keyframe = frame.time - last_.keyframe_time();
  evidence.keyframes = map.keyframe_count();
  evidence.motion = result.cam_from_reference.translation().norm() / median_distance(map, frame);
  const double anywhere = std::numeric_limits<double>::infinity();
  evidence.is_redundant = matcher_.is_redundant(map, frame, anywhere, 0);
  return needs_keyframe(evidence, options_.max_features, options_.keyframes);
}

}  // namespace hybrid_slam
