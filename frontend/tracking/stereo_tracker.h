#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "frontend/odometry/disparity_calibrator.h"
#include "frontend/odometry/odometry_chain.h"
#include "frontend/odometry/stereo_odometer.h"
#include "frontend/tracking/frame.h"
#include "frontend/tracking/last_frame.h"
#include "frontend/tracking/map_matcher.h"
#include "frontend/tracking/tracked_frame.h"
#include "frontend/tracking/uncertain_pose.h"

namespace hybrid_slam {

struct StereoTrackerOptions : TrackerOptions {
  double min_initial_share = 0.08;  // of N: features, and features with depth, to start the map
  double close_baselines = 40;   // nearer than this many baselines, one stereo pair fixes a point
  int min_new_points = 100;      // a keyframe makes at least the nearest ones
  double last_frame_radius = 7;  // [px]; doubled when few match
  double last_frame_retry_share = 0.08;  // of N
  double last_frame_min_share = 0.06;    // of N
  int min_reference_matches = 30;
  int min_pose_inliers = 10;
  int min_odometer_inliers = 20;  // to go on by odometry where the map does not hold
  // Whether the map goes on with another component where the vehicle is lost and sees no place that
  // it knows; see backend/map/components.h.
  bool new_components = true;
  StereoOdometerOptions odometer;
  DisparityCalibratorOptions disparity;

  std::string validate() const;
};

// Tracks stereo frames one after the other against snapshots of the map (steps 1 to 7 of the
// paper's section on tracking). One thread at a time. It never changes the map: it says which
// frames should become keyframes, and finds them in the next snapshot.
class StereoTracker {
 public:
  // `places`: where to look for lost frames (MapMatcher). Throws std::invalid_argument if the
  // options are not valid.
  StereoTracker(CameraId camera_id, const Calibrated<RectifiedStereo>& camera,
                const StereoTrackerOptions& options,
                std::shared_ptr<const KeyframeDatabase> places = nullptr);

  // `allow_keyframe`: false while mapping has more waiting than it can take.
  TrackedFrame track(Frame frame, const MapSnapshot& map, bool allow_keyframe = true);

  // What the last frame's pose is off by, for relative_pose(); null if it was lost.
  const UncertainPose* uncertain_pose() const { return uncertain_ ? &*uncertain_ : nullptr; }

 private:
  TrackedFrame initialize(Frame& frame, const MapSnapshot& map) const;
  bool can_carry_map(const Frame& frame) const;
  bool begin_component(Frame& frame, const MapSnapshot& map, TrackedFrame& result);
  void correct_disparities(Frame& frame) const;
  std::optional<StereoMotion> predict(Frame& frame, TrackedFrame& result);
  std::vector<PoseObservation> points_of_last_frame(const StereoMotion& motion,
                                                    const Frame& frame) const;
  bool track_last_frame(Frame& frame, const MapSnapshot& map, TrackedFrame& result) const;
  bool track_reference(Frame& frame, const MapSnapshot& map) const;
  std::optional<Matrix6d> track_local_map(Frame& frame, const MapSnapshot& map, int min_inliers,
                                          TrackedFrame& result) const;
  bool wants_keyframe(const Frame& frame, const MapSnapshot& map, const TrackedFrame& result) const;
  NewKeyframe make_keyframe(const Frame& frame, const MapSnapshot& map, KeyframeId reference) const;
  double close_depth() const { return options_.close_baselines * baseline(camera_); }
  int share_of_features(const Frame& frame, double share) const;
  TrackedFrame remember(const MapSnapshot& map, Frame frame, TrackedFrame result);

  CameraId camera_id_;
  Camera camera_;
  StereoTrackerOptions options_;
  StereoOdometer odometer_;
  OdometryChain chain_;
  DisparityCalibrator disparity_;
  MapMatcher matcher_;
  LastFrame last_;
  std::optional<UncertainPose> uncertain_;  // the last frame
};

}  // namespace hybrid_slam
