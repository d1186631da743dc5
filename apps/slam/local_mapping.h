#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "apps/io/stage_times.h"
#include "apps/slam/inputs.h"
#include "apps/slam/slam_options.h"
#include "backend/backend.h"
#include "frontend/mapping/culling.h"
#include "frontend/tracking/tracked_frame.h"

namespace hybrid_slam {

// A frame that shall become a keyframe, and what tracking counted since the last one.
struct MappingJob {
  CameraKind camera = CameraKind::kStereo;
  NewKeyframe keyframe;
  Rigid3d reference_from_world;  // pose of keyframe.reference in the map it was tracked in
  std::vector<LandmarkCount> counts;
  double disparity_offset = 0;  // [px] that was taken out of a stereo keyframe's disparities
  RigCorrection correction{};   // what is known of the stereo pair by now

  std::int64_t frame_index() const { return keyframe.observations->frame_index; }
};

// What tracking knows when a run ends.
struct TrackingEnd {
  std::vector<LandmarkCount> counts;  // since the last keyframe
  CameraId stereo;
  // Of the stereo pair; none where the map is to stay as it is.
  std::optional<RigCorrection> correction;
  double disparity_offset = 0;  // [px] of the last stereo frame
};

// How often tracking saw each landmark since the last keyframe: no larger than the part of the map
// that was in view, however long no keyframe comes.
class LandmarkCounts {
 public:
  void add(const SeenLandmarks& frame);

  // Ascending by landmark; begins anew.
  std::vector<LandmarkCount> take();

 private:
  std::map<LandmarkId, LandmarkCount> counts_;
};

// What happens for each new keyframe, step by step: the frontend decides, the backend applies and
// optimises. Owns the map. Synchronous; one thread at a time.
class LocalMapping {
 public:
  // Goes on with `map`, if that is not empty.
  explicit LocalMapping(const SlamOptions& options, Map map = {});

  // The map's camera of these numbers, or a new one.
  CameraId camera_id(const Camera& camera);

  // `publish` is called whenever the map is worth looking at: once it holds the keyframe, and at
  // the end.
  KeyframeId process(const MappingJob& job, StageTimes& times,
                     const std::function<void()>& publish);

  // The same in steps. The keyframe comes into the map and is linked with its neighbours; not while
  // an update works if moves_the_map(job).
  KeyframeId insert(const MappingJob& job, StageTimes& times);
  bool moves_the_map(const MappingJob& job) const;
  // The map is optimised around these, beside: see LocalUpdate.
  LocalUpdate begin_update(std::span<const KeyframeId> newest) {
    return backend_.begin_local(newest);
  }
  // Takes that in, and culls what these new keyframes make redundant.
  void end_update(LocalUpdate update, std::span<const KeyframeId> added, StageTimes& times);

  // Closes a verified loop: moves the map, joins the two sides and looks for more that they have in
  // common. `publish` is called if it was closed.
  LoopOutcome close(const LoopMeasurement& loop, StageTimes& times,
                    const std::function<void()>& publish);

  // The same in steps: how the map must move is found out beside, see LoopUpdate; if the loop was
  // closed, a local update from its keyframe on belongs between the last two.
  LoopUpdate begin_close(const LoopMeasurement& loop) { return backend_.begin_close(loop); }
  LoopOutcome end_close(LoopUpdate update, StageTimes& times);
  void fuse_sides(const LoopMeasurement& loop, StageTimes& times);

  // How often the map was moved by a loop.
  std::size_t closings() const { return backend_.closings(); }

  // Takes in what solve_full() made of a snapshot, when that many loops had moved the map.
  void take_in_full(BundleResult result, std::size_t closings_then, StageTimes& times);

  // The same in steps, see FullUpdate.
  FullUpdate begin_full(BundleResult result, std::size_t closings_then) {
    return backend_.begin_full(std::move(result), closings_then);
  }
  void end_full(FullUpdate update, StageTimes& times);

  // Adjusts everything at once, if the options want it for a map of this size.
  void adjust_full(StageTimes& times, const std::function<void()>& publish);

  // Nothing comes after it. Landmarks too young to have been judged are judged by what was counted
  // since the last keyframe: what moves by itself would stay in the map otherwise.
  void conclude(const TrackingEnd& end);

  std::shared_ptr<const MapSnapshot> snapshot() { return backend_.snapshot(); }
  const Map& map() const { return backend_.map(); }

 private:
  void take_in(CameraId stereo, const RigCorrection& correction, const FrameObservations& seen,
               double offset);
  double in_use(CameraId stereo) const;
  bool is_worth_a_shift(CameraId stereo, const FrameObservations& seen, double offset) const;

  SlamOptions options_;
  Backend backend_;
  LandmarkProbation probation_;
  KeyframeUse use_;
  KeyframeId first_own_;  // what is before it was in the map that this goes on with
  std::optional<double> disparity_offset_;  // [px] that was taken out of its own stereo keyframes
};

}  // namespace hybrid_slam
