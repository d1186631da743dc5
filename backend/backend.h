#pragma once

#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "backend/full_update.h"
#include "backend/incremental/map_smoother.h"
#include "backend/local_update.h"
#include "backend/loop_update.h"
#include "backend/map/loop_measurement.h"
#include "backend/map/map.h"
#include "backend/problem/full_bundle.h"
#include "backend/problem/local_bundle.h"
#include "backend/problem/loop_closure.h"
#include "backend/problem/loop_correction.h"

namespace hybrid_slam {

// What improves the map after each new keyframe.
enum class LocalMethod {
  kIncremental,  // incremental smoothing of the whole graph
  kBundle,       // bundle adjustment of the keyframe's surroundings
};

struct BackendOptions {
  LocalMethod local_method = LocalMethod::kIncremental;
  LocalBundleOptions local;
  MapSmootherOptions incremental;
  FullBundleOptions full;
  LoopClosureOptions loops;
  int max_refused_loops = 8;  // that are remembered: the newest

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// The synchronous facade of the backend: owns the map, applies what the frontend sends, optimises.
// Knows no threads; a pipeline gives it to one worker, and everyone else reads snapshots.
class Backend {
 public:
  // Goes on with `map`. Throws std::invalid_argument if the options are not valid.
  explicit Backend(const BackendOptions& options, Map map = {});

  CameraId add_camera(const Camera& camera);
  KeyframeId add(const NewKeyframe& keyframe);
  void apply(const MapEdit& edit);
  void set_keep(KeyframeId id);  // exempt from culling

  // Of keyframes that are out of use; see Map::drop_features(). What others were told before of
  // their keypoints still holds: results of earlier snapshots are taken in all the same.
  void drop_features(const std::vector<KeyframeId>& keyframes);

  // All disparities of a stereo camera become larger by so much [px], from the keyframe `first` on:
  // see shift_disparities(). The next optimisation adjusts everything; a full one of an earlier
  // snapshot is no longer taken in.
  void shift_disparities(CameraId camera, double by, KeyframeId first = KeyframeId(0));

  // What is known of a stereo camera by now; see Map.
  void set_correction(CameraId camera, const RigCorrection& correction);

  // Improves the map after the newest keyframe was added, by the method of the options; outlier
  // observations are erased from the map. Looks at `stop` between iterations and keeps what it has
  // when stopped.
  BundleSummary optimize_local(KeyframeId newest, const std::stop_token& stop = {});

  // The same in steps, so that the work can be done beside; `newest`: the keyframes that came since
  // the last time, ascending, at least one. Between the two keyframes may be added and edits
  // applied: what came since is carried along. All that moves the map or renumbers keypoints has to
  // wait for end_local(): std::logic_error.
  LocalUpdate begin_local(std::span<const KeyframeId> newest);
  BundleSummary end_local(LocalUpdate update);

  // Takes in what optimize_local() found far from the newest keyframes and has left for later.
  void catch_up();

  // Closes a loop. One between two components first brings the one without the origin, or the
  // smaller one, to where the loop sees it. Then the loop graph moves every keyframe, landmarks
  // follow, those of the two sides that are the same are merged. A loop that is not believed
  // changes nothing, but is remembered: a later one may agree with it.
  LoopOutcome close(const LoopMeasurement& loop);

  // The same in steps, between which keyframes may be added and edits applied, as between those of
  // a local update: what came since is carried along.
  LoopUpdate begin_close(const LoopMeasurement& loop);
  LoopOutcome end_close(LoopUpdate update);

  // How often close() has moved the map.
  std::size_t closings() const { return first_move_ + moves_.size(); }

  // Takes in a bundle adjustment of everything that was made of an earlier snapshot (solve_full),
  // when the map had been moved by `closings_then` loops: it is carried over those that were closed
  // since. Keyframes born since follow through the spanning tree, landmarks with their reference
  // keyframe. Left out is a result that is older than one which was taken in, than the loops that
  // are remembered, or than one that changed scales.
  BundleSummary take_in_full(BundleResult result, std::size_t closings_then);

  // The same in steps, as those of a loop.
  FullUpdate begin_full(BundleResult result, std::size_t closings_then);
  BundleSummary end_full(FullUpdate update);

  // Bundle adjustment of everything but the origin: solve_full and take_in_full.
  BundleSummary optimize_full(const std::stop_token& stop = {});

  std::shared_ptr<const MapSnapshot> snapshot();
  const MapSnapshot& view() const { return map_.view(); }
  const Map& map() const { return map_; }

 private:
  void require_update(const char* what);
  void take_in_moves(const MapSnapshot& then, Map moved, BundleResult& result);
  void erase(std::vector<LandmarkObservation> outliers);
  void take_in(LoopUpdate& update);
  void remember_move(const MapSnapshot& before, const BundleResult& correction);
  void move(const BundleResult& correction);
  void bring_together(const LoopMeasurement& loop);
  void merge_sides(const LoopMeasurement& loop);
  MapSmoother& smoother();
  void moved_by_others(bool cameras_too);
  void forget_moves(std::size_t count);
  void require_no_update(const char* what) const;

  BackendOptions options_;
  Map map_;
  std::optional<MapSmoother> smoother_;   // in step with the map
  bool updating_ = false;                 // between begin_...() and end_...()
  std::vector<LoopMeasurement> refused_;  // oldest first
  std::vector<PoseConstraint> closed_;    // loops, as measured, weighted
  // What close() did to the map, for results that are still to come: the newest, oldest first.
  std::vector<LoopMove> moves_;
  std::size_t first_move_ = 0;  // how many are no longer kept
};

// Bundle adjustment of everything but the origin, of a snapshot: in any thread.
BundleResult solve_full(const MapSnapshot& map, const FullBundleOptions& options,
                        const std::stop_token& stop = {});

}  // namespace hybrid_slam
