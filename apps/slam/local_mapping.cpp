#include "apps/slam/local_mapping.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "frontend/calibration/rig_calibrator.h"
#include "frontend/mapping/fusion.h"
#include "frontend/mapping/triangulation.h"

namespace hybrid_slam {

namespace {

// The keyframe as it lies in `map`, which may have moved since it was tracked: by a loop that was
// closed, far.
NewKeyframe carried_along(const MappingJob& job, const MapSnapshot& map) {
  NewKeyframe keyframe = job.keyframe;
  if (!keyframe.reference.valid()) return keyframe;
  const Rigid3d reference = map.cam_from_world(keyframe.reference);
  if (reference.params == job.reference_from_world.params) return keyframe;
  const Rigid3d now_from_then = inverse(reference) * job.reference_from_world;
  keyframe.cam_from_world = keyframe.cam_from_world * inverse(now_from_then);
  for (auto& [keypoint, point] : keyframe.new_points) point = now_from_then * point;
  return keyframe;
}

}  // namespace

void LandmarkCounts::add(const SeenLandmarks& frame) {
  const auto count_of = [&](LandmarkId id) -> LandmarkCount& {
    return counts_.try_emplace(id, LandmarkCount{id}).first->second;
  };
  for (const LandmarkId id : frame.visible) ++count_of(id).visible;
  for (const LandmarkId id : frame.found) ++count_of(id).found;
}

std::vector<LandmarkCount> LandmarkCounts::take() {
  std::vector<LandmarkCount> counts;
  counts.reserve(counts_.size());
  for (const auto& [id, count] : counts_) counts.push_back(count);
  counts_.clear();
  return counts;
}

LocalMapping::LocalMapping(const SlamOptions& options, Map map)
    : options_(options),
      backend_(options.backend, std::move(map)),
      probation_(options.culling),
      use_(options.culling, backend_.view()),
      first_own_(backend_.view().next_keyframe_id()) {}

CameraId LocalMapping::camera_id(const Camera& camera) {
  const MapSnapshot& map = backend_.view();
  for (std::uint32_t i = 0; i < map.camera_count(); ++i) {
    if (map.camera(CameraId(i)) == camera) return CameraId(i);
  }
  return backend_.add_camera(camera);
}

KeyframeId LocalMapping::process(const MappingJob& job, StageTimes& times,
                                 const std::function<void()>& publish) {
  const KeyframeId id = insert(job, times);
  publish();
  LocalUpdate update = begin_update({&id, 1});
  update.run();
  end_update(std::move(update), {&id, 1}, times);
  publish();
  return id;
}

KeyframeId LocalMapping::insert(const MappingJob& job, StageTimes& times) {
  StageClock clock(times);
  MapEdit counts;
  counts.counted = job.counts;
  backend_.apply(counts);
  if (job.camera == CameraKind::kStereo) {
    const FrameObservations& seen = *job.keyframe.observations;
    take_in(seen.camera, job.correction, seen, job.disparity_offset);
  }
  const KeyframeId id = backend_.add(carried_along(job, backend_.view()));
  backend_.apply(probation_.cull(backend_.view(), id));
  clock.lap("insert_keyframe");
  backend_.apply(triangulate_with_neighbours(backend_.view(), id, options_.triangulation));
  clock.lap("triangulate");
  backend_.apply(fuse_with_neighbours(backend_.view(), id, options_.fusion));
  clock.lap("fuse");
  return id;
}

void LocalMapping::end_update(LocalUpdate update, std::span<const KeyframeId> added,
                              StageTimes& times) {
  times.add("local_bundle", 1e3 * update.seconds());
  StageClock clock(times);
  backend_.end_local(std::move(update));
  clock.lap("take_in_local_bundle");
  for (const KeyframeId id : added) {
    if (backend_.view().find(id) == nullptr) continue;
    backend_.apply(cull_keyframes(backend_.view(), id, options_.culling));
  }
  clock.lap("cull_keyframes");
  backend_.drop_features(use_.gone_out(backend_.view()));
  clock.lap("drop_features");
}

// Of the disparities of this run's stereo keyframes [px].
double LocalMapping::in_use(CameraId stereo) const {
  if (disparity_offset_) return *disparity_offset_;
  const auto known = backend_.view().correction(stereo).disparity;
  return known ? known->in_use : 0;
}

// Of a rig that is hardly off, what was found is left to the keyframes to come: less than the map
// may be off by anyway is not worth moving all of it.
bool LocalMapping::is_worth_a_shift(CameraId stereo, const FrameObservations& seen,
                                    double offset) const {
  const double before = in_use(stereo);
  const double disparity = median_disparity(seen.features, seen.u_right);
  return offset != before && disparity > 0 &&
         std::max(std::abs(offset), std::abs(before)) >= kDoubtfulScale * disparity;
}

bool LocalMapping::moves_the_map(const MappingJob& job) const {
  const FrameObservations& seen = *job.keyframe.observations;
  return job.camera == CameraKind::kStereo &&
         is_worth_a_shift(seen.camera, seen, job.disparity_offset);
}

// What was found out about the pair meanwhile holds for all keyframes of this run, not for the new
// ones alone. Keyframes of runs before keep what these have found: it is the better, or the pair
// stood otherwise. `seen`: by the pair, lately.
void LocalMapping::take_in(CameraId stereo, const RigCorrection& correction,
                           const FrameObservations& seen, double offset) {
  disparity_offset_ = in_use(stereo);
  backend_.set_correction(stereo, correction);
  if (!is_worth_a_shift(stereo, seen, offset)) return;
  backend_.shift_disparities(stereo, offset - *disparity_offset_, first_own_);
  if (options_.backend.full.enabled) backend_.optimize_full();
  disparity_offset_ = offset;
}

LoopOutcome LocalMapping::close(const LoopMeasurement& loop, StageTimes& times,
                                const std::function<void()>& publish) {
  LoopUpdate move = begin_close(loop);
  move.run();
  const LoopOutcome outcome = end_close(std::move(move), times);
  if (outcome.end != LoopEnd::kClosed) return outcome;
  LocalUpdate update = begin_update({&loop.keyframe, 1});
  update.run();
  end_update(std::move(update), {}, times);
  fuse_sides(loop, times);
  publish();
  return outcome;
}

LoopOutcome LocalMapping::end_close(LoopUpdate update, StageTimes& times) {
  times.add("close_loop", 1e3 * update.seconds());
  StageClock clock(times);
  const LoopOutcome outcome = backend_.end_close(std::move(update));
  clock.lap("take_in_loop");
  return outcome;
}

void LocalMapping::fuse_sides(const LoopMeasurement& loop, StageTimes& times) {
  StageClock clock(times);
  backend_.apply(fuse_places(backend_.view(), loop.keyframe, loop.match, options_.fusion));
  clock.lap("fuse");
}

void LocalMapping::take_in_full(BundleResult result, std::size_t closings_then, StageTimes& times) {
  FullUpdate update = begin_full(std::move(result), closings_then);
  update.run();
  end_full(std::move(update), times);
}

void LocalMapping::end_full(FullUpdate update, StageTimes& times) {
  StageClock clock(times);
  backend_.end_full(std::move(update));
  clock.lap("take_in_full_bundle");
}

void LocalMapping::adjust_full(StageTimes& times, const std::function<void()>& publish) {
  if (!options_.backend.full.enabled) return;
  StageClock clock(times);
  BundleResult result = solve_full(backend_.view(), options_.backend.full);
  clock.lap("full_bundle");
  take_in_full(std::move(result), backend_.closings(), times);
  publish();
}

void LocalMapping::conclude(const TrackingEnd& end) {
  backend_.catch_up();
  MapEdit counted;
  counted.counted = end.counts;
  backend_.apply(counted);
  backend_.apply(probation_.conclude(backend_.view()));
  const Keyframe* newest = backend_.view().newest_keyframe(end.stereo);
  if (!end.correction || newest == nullptr) return;
  take_in(end.stereo, *end.correction, *newest->observations, end.disparity_offset);
}

}  // namespace hybrid_slam
