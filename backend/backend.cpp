#include "backend/backend.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "backend/map/disparity_shift.h"
#include "backend/map/dropped_features.h"
#include "backend/problem/loop_correction.h"
#include "backend/problem/solve_bundle.h"

namespace hybrid_slam {

namespace {

// Observations by keypoints of one keyframe; those that it no longer has go.
void renumber(std::vector<LandmarkObservation>& observations,
              const std::vector<std::uint32_t>& kept) {
  std::erase_if(observations, [&](LandmarkObservation& one) {
    const auto keypoint = new_keypoint(kept, one.observation.keypoint);
    one.observation.keypoint = keypoint.value_or(one.observation.keypoint);
    return !keypoint;
  });
}

}  // namespace

std::string BackendOptions::validate() const {
  const auto named = [](const char* name, const std::string& wrong) {
    return wrong.empty() ? wrong : std::string("backend: ") + name + ": " + wrong;
  };
  for (const std::string& error :
       {named("local bundle", local.problem.validate()),
        named("incremental", incremental.validate()), named("full bundle", full.problem.validate()),
        named("loops", loops.validate())}) {
    if (!error.empty()) return error;
  }
  return max_refused_loops < 0 ? "backend: max_refused_loops must not be negative" : "";
}

Backend::Backend(const BackendOptions& options, Map map) : options_(options), map_(std::move(map)) {
  const std::string wrong = options.validate();
  if (!wrong.empty()) throw std::invalid_argument(wrong);
}

CameraId Backend::add_camera(const Camera& camera) { return map_.add_camera(camera); }

KeyframeId Backend::add(const NewKeyframe& keyframe) { return map_.add_keyframe(keyframe); }

void Backend::apply(const MapEdit& edit) { map_.apply(edit); }

void Backend::set_keep(KeyframeId id) { map_.set_keep(id); }

void Backend::drop_features(const std::vector<KeyframeId>& keyframes) {
  require_no_update("drop_features");
  for (const KeyframeId id : keyframes) {
    const std::vector<std::uint32_t> kept = map_.drop_features(id);
    if (smoother_) smoother_->renumber(id, kept);
    for (LoopMeasurement& loop : refused_) {
      if (loop.keyframe == id) renumber(loop.new_observations, kept);
    }
  }
}

void Backend::set_correction(CameraId camera, const RigCorrection& correction) {
  map_.set_correction(camera, correction);
}

void Backend::shift_disparities(CameraId camera, double by, KeyframeId first) {
  require_no_update("shift_disparities");
  BundleResult as_it_was;
  for (const KeyframeId id : view().keyframe_ids()) {
    as_it_was.cam_from_world.emplace_back(id, view().at(id).cam_from_world);
  }
  move(as_it_was);  // a state of its own, so that results of the one before are recognised
  forget_moves(moves_.size());
  const double scale = hybrid_slam::shift_disparities(map_, camera, by, first);
  const auto resized = [&](const Sim3d& a_from_b) {
    return Sim3d(a_from_b.rotation(), scale * a_from_b.translation(), a_from_b.scale());
  };
  for (PoseConstraint& loop : closed_) loop.a_from_b = resized(loop.a_from_b);
  for (LoopMeasurement& loop : refused_) {
    loop.keyframe_from_match = resized(loop.keyframe_from_match);
  }
  smoother_.reset();
}

BundleSummary Backend::optimize_local(KeyframeId newest, const std::stop_token& stop) {
  LocalUpdate update = begin_local({&newest, 1});
  update.run(stop);
  return end_local(std::move(update));
}

LocalUpdate Backend::begin_local(std::span<const KeyframeId> newest) {
  require_no_update("begin_local");
  if (newest.empty()) throw std::logic_error("Backend::begin_local: no keyframe");
  LocalUpdate update(map_, {newest.begin(), newest.end()});
  update.local_ = options_.local;
  if (options_.local_method == LocalMethod::kIncremental) update.smoother_ = &smoother();
  updating_ = true;
  return update;
}

void LocalUpdate::run(const std::stop_token& stop) {
  if (smoother_ == nullptr) {
    result_ = solve_bundle(*map_, make_local_bundle(*map_, newest_, local_), stop);
  } else {
    result_ = smoother_->update(map_, newest_, stop);
    covariances_ = smoother_->covariances(*map_);
  }
  moved_.move(result_.cam_from_world, result_.point_in_world);
}

BundleSummary Backend::end_local(LocalUpdate update) {
  require_update("end_local");
  take_in_moves(*update.map_, std::move(update.moved_), update.result_);
  erase(std::move(update.result_.outliers));
  if (update.covariances_ != nullptr) map_.set_covariances(std::move(update.covariances_));
  return update.result_.summary;
}

void Backend::require_no_update(const char* what) const {
  if (updating_) {
    throw std::logic_error(std::string("Backend::") + what + ": an update is not ended");
  }
}

// It ends with this.
void Backend::require_update(const char* what) {
  if (!std::exchange(updating_, false)) {
    throw std::logic_error(std::string("Backend::") + what + ": no update was begun");
  }
}

// The map moves as the branch did by this result, which gets what came into the map since: it is
// carried along.
void Backend::take_in_moves(const MapSnapshot& then, Map moved, BundleResult& result) {
  const auto poses = std::ssize(result.cam_from_world);
  const auto points = std::ssize(result.point_in_world);
  carry_newcomers(then, view(), result);
  map_.take_in_moves(then, std::move(moved));
  map_.move({result.cam_from_world.begin() + poses, result.cam_from_world.end()},
            {result.point_in_world.begin() + points, result.point_in_world.end()});
}

void Backend::erase(std::vector<LandmarkObservation> outliers) {
  MapEdit edit;
  edit.erased_observations = std::move(outliers);
  map_.apply(edit);
}

void Backend::catch_up() {
  require_no_update("catch_up");
  if (!smoother_) return;
  const BundleResult rest = smoother_->rest(view());
  map_.move(rest.cam_from_world, rest.point_in_world);
}

// The oldest.
void Backend::forget_moves(std::size_t count) {
  moves_.erase(moves_.begin(), moves_.begin() + static_cast<std::ptrdiff_t>(count));
  first_move_ += count;
}

// The smoother follows. What it has marginalised cannot, nor can factors of other cameras.
void Backend::moved_by_others(bool cameras_too) {
  if (cameras_too || options_.incremental.solver.window > 0) smoother_.reset();
}

MapSmoother& Backend::smoother() {
  if (!smoother_) {
    smoother_.emplace(options_.incremental);
    for (const PoseConstraint& loop : closed_) smoother_->add_loop(loop);
  }
  return *smoother_;
}

BundleResult solve_full(const MapSnapshot& map, const FullBundleOptions& options,
                        const std::stop_token& stop) {
  return solve_bundle(map, make_full_bundle(map, options), stop);
}

BundleSummary Backend::take_in_full(BundleResult result, std::size_t closings_then) {
  FullUpdate update = begin_full(std::move(result), closings_then);
  update.run();
  return end_full(std::move(update));
}

FullUpdate Backend::begin_full(BundleResult result, std::size_t closings_then) {
  require_no_update("begin_full");
  if (closings_then > closings()) {
    throw std::logic_error("Backend::begin_full: a result of loops that were not closed");
  }
  updating_ = true;
  FullUpdate update(std::move(result));
  if (closings_then < first_move_) return update;
  forget_moves(closings_then - first_move_);
  if (update.result_.cam_from_world.empty()) return update;
  update.map_ = map_.snapshot();
  update.moved_ = map_.branch();
  update.moves_ = moves_;
  return update;
}

void FullUpdate::run() {
  if (map_ == nullptr) return;
  for (const LoopMove& move : moves_) carry_over(move, *map_, result_);
  carry_the_rest(*map_, result_);
  moved_.move(result_.cam_from_world, result_.point_in_world);
}

BundleSummary Backend::end_full(FullUpdate update) {
  require_update("end_full");
  BundleResult& result = update.result_;
  if (update.map_ == nullptr) return result.summary;
  moved_by_others(!result.cameras.empty());
  take_in_moves(*update.map_, std::move(update.moved_), result);
  for (const auto& [id, camera] : result.cameras) map_.set_camera(id, camera);
  erase(std::move(result.outliers));
  return result.summary;
}

BundleSummary Backend::optimize_full(const std::stop_token& stop) {
  return take_in_full(solve_full(view(), options_.full, stop), closings());
}

std::shared_ptr<const MapSnapshot> Backend::snapshot() { return map_.snapshot(); }

}  // namespace hybrid_slam
