#pragma once

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "frontend/calibration/disparity_calibrator.h"
#include "frontend/odometry/odometry_chain.h"
#include "frontend/tracking/frame.h"
#include "frontend/tracking/last_frame.h"
#include "frontend/tracking/map_matcher.h"
#include "frontend/tracking/motion_ladder.h"
#include "frontend/tracking/moving_regions.h"
#include "frontend/tracking/stereo_keyframe.h"
#include "frontend/tracking/tracked_frame.h"
#include "frontend/tracking/uncertain_pose.h"

namespace hybrid_slam {

struct StereoTrackerOptions : TrackerOptions {
  // Of N: features, and features with depth, with which one frame starts the map. With fewer, two
  // in a row do between which a motion is believed.
  double min_initial_share = 0.08;
  double close_baselines = 40;   // nearer than this many baselines, one stereo pair fixes a point
  int min_new_points = 100;      // a keyframe makes at least the nearest ones
  double last_frame_radius = 7;  // [px]; doubled when too few match
  // No effect any more: whether a pose is believed, is_believed() says.
  double last_frame_retry_share = 0.08;
  double last_frame_min_share = 0.06;
  int min_reference_matches = 30;
  int min_pose_inliers = 10;
  int min_odometer_inliers = 20;
  // Whether the map goes on with another component where the vehicle is lost and sees no place that
  // it knows; see backend/map/components.h.
  bool new_components = true;
  // Whether what moves by itself is kept out of the map; see MovingRegions.
  bool moving_regions = true;
  StereoOdometerOptions odometer;
  DisparityCalibratorOptions disparity;

  std::string validate() const;
};

// Tracks stereo frames one after the other against snapshots of the map (steps 1 to 7 of the
// paper's section on tracking). One thread at a time. It never changes the map: it says which
// frames should become keyframes, and finds them in the next snapshot. A frame that fails costs
// nothing but itself: the next one is compared with the last good one (docs/tracking.md).
class StereoTracker {
 public:
  // `places`: where to look for lost frames (MapMatcher). `known`: of the camera, by an earlier
  // run: offset and shading begin with it. Throws std::invalid_argument if the options are not
  // valid.
  StereoTracker(CameraId camera_id, const Calibrated<RectifiedStereo>& camera,
                const StereoTrackerOptions& options,
                std::shared_ptr<const KeyframeDatabase> places = nullptr,
                const RigCorrection& known = {});

  // `allow_keyframe`: false while mapping has more waiting than it can take.
  TrackedFrame track(Frame frame, const MapSnapshot& map, bool allow_keyframe = true);

  // What the camera's keypoints are off by besides their own noise, from now on; null: nothing.
  // Those of the frames to come have it in their standard deviations already.
  void use_floor(std::shared_ptr<const NoiseFloor> floor) { matcher_.use_floor(std::move(floor)); }

  // What the last frame's pose is off by, for relative_pose(); null if it was not tracked.
  const UncertainPose* uncertain_pose() const {
    return uncertain_ && last_.tracked() ? &*uncertain_ : nullptr;
  }

  const DisparityCalibrator& disparity() const { return disparity_; }
  const RunningEstimate& shading_estimate() const { return matcher_.shading_estimate(); }

  // See TrackRefiner.
  ShadingDoubt shading_doubt() const { return matcher_.shading_doubt(); }

 private:
  // A frame since the last tracked one, whose place is not known well enough.
  struct Unplaced {
    Frame frame;
    UncertainMotion from_last;  // frame_from_last
  };

  TrackedFrame initialize(Frame& frame, const MapSnapshot& map) const;
  bool can_carry_map(const Frame& frame) const;
  bool continues_untracked(const Frame& frame) const;
  void begin_component(Frame& frame, const MapSnapshot& map, TrackedFrame& result);
  void correct_disparities(Frame& frame) const;
  std::optional<LadderStep> predict(Frame& frame, TrackedFrame& result);
  std::optional<LadderStep> across_gap(const Frame& frame) const;
  bool follows_last(const Frame& frame) const;
  void track_onwards(Frame& frame, const MapSnapshot& map, TrackedFrame& result);
  bool is_contradicted(const LadderStep& step, const Rigid3d& predicted, const Frame& frame,
                       const MapMatcher::LocalMapMatch& match) const;
  void relocalize(Frame& frame, const MapSnapshot& map, TrackedFrame& result);
  void coast(const Frame& frame, const MapSnapshot& map, TrackedFrame& result);
  std::vector<PoseObservation> points_of_last_frame(const StereoMotion& motion,
                                                    const Frame& frame) const;
  bool track_last_frame(Frame& frame, const MapSnapshot& map, TrackedFrame& result) const;
  bool track_keyframes(Frame& frame, const MapSnapshot& map) const;
  std::optional<MapMatcher::LocalMapMatch> track_local_map(Frame& frame, const MapSnapshot& map);
  void lengthen_chain(const MapSnapshot& map, const Frame& frame, const Rigid3d& predicted,
                      const std::optional<LadderStep>& step, bool agreed,
                      const std::optional<UncertainPose>& last);
  void bridge_chain(const MapSnapshot& map, const std::optional<UncertainPose>& last);
  bool wants_keyframe(const Frame& frame, const MapSnapshot& map, const TrackedFrame& result) const;
  NewKeyframe make_keyframe(const Frame& frame, const MapSnapshot& map, KeyframeId reference) const;
  void learn_offset(const Frame& frame, const MapSnapshot& map, KeyframeId reference);
  void learn_moving(const LadderStep& step, const Frame& frame);
  LeftOutKeypoints moving(const Frame& frame) const;
  double close_depth() const { return options_.close_baselines * baseline(camera_); }
  TrackedFrame remember(const MapSnapshot& map, Frame frame, TrackedFrame result);

  CameraId camera_id_;
  Camera camera_;
  StereoTrackerOptions options_;
  MotionLadder ladder_;
  OdometryChain chain_;
  DisparityCalibrator disparity_;
  MapMatcher matcher_;
  MovingRegions moving_;
  LastFrame last_;
  std::optional<UncertainPose> uncertain_;  // the last tracked frame
  double depth_ = 0;                        // of the scene that it showed [m]
  std::optional<Unplaced> unplaced_;        // after it; none right after it
  std::optional<Frame> untracked_;          // the frame before, if that was not tracked
};

}  // namespace hybrid_slam
