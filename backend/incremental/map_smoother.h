#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <stop_token>
#include <unordered_map>
#include <utility>
#include <vector>

#include "backend/incremental/incremental_options.h"
#include "backend/incremental/paged_table.h"
#include "backend/map/map_snapshot.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

class IncrementalSolver;

struct MapSmootherOptions {
  IncrementalOptions solver;
  // Poses of the map follow the estimate once they are off by more [m, rad].
  double min_motion = 1e-5;
  // The same of those that share no landmark with the newest: a tenth of a pixel in an image. All
  // but a rest is noise of the estimate, which comes and goes.
  double min_far_motion = 1e-4;

  MapSmootherOptions() {
    solver.loss = Loss::kHuber;
    solver.loop_loss = Loss::kCauchy;
  }
  std::string validate() const;
};

// Incremental smoothing of a map that grows: an IncrementalSolver kept in step with it. Each update
// takes in what changed in the map, whatever it was (keyframes and landmarks that came or went,
// observations, merged landmarks, odometry, keyframes that others moved), at the price of that
// change. All keyframes but the origin vary, or those of the solver's window: with a window, moving
// the map by other means asks for a new smoother, since what was marginalised cannot follow.
class MapSmoother {
 public:
  explicit MapSmoother(const MapSmootherOptions& options);
  ~MapSmoother();

  // A motion measured between two keyframes, with its weight and without scale: an edge of the
  // problem from the next update on, whose map must have both. With a window it holds the present
  // to a past that no longer varies.
  void add_loop(const PoseConstraint& loop) { new_loops_.push_back(loop); }

  // Features of a keyframe were dropped from the map: `kept` are the old indices of those it has
  // still, ascending. To be called each time, before the update that sees it.
  void renumber(KeyframeId keyframe, std::span<const std::uint32_t> kept);

  // The map as it is now, with `newest` in it: the keyframes that came since the last update,
  // ascending, at least one. The result holds what moved, far from the newest keyframes as much of
  // it as near them (rest() has what is left; after a loop nothing is), and as outliers the
  // observations beyond their threshold of the landmarks that `newest` see: they are out of the
  // smoother's problem, and the map is to follow.
  // `stop`: see IncrementalSolver::update.
  BundleResult update(std::shared_ptr<const MapSnapshot> map, std::span<const KeyframeId> newest,
                      const std::stop_token& stop = {});
  BundleResult update(std::shared_ptr<const MapSnapshot> map, KeyframeId newest,
                      const std::stop_token& stop = {}) {
    return update(std::move(map), {&newest, 1}, stop);
  }

  // What results have yet to say of keyframes that moved, all of it; to be taken in at the end.
  // `map`: the last update's, with what came since.
  BundleResult rest(const MapSnapshot& map);

  // How certain the keyframes are, as of the last update: of the map's newest one of each camera,
  // then of those that share most landmarks with these, and of those that come with them, up to a
  // bounded cost. Those that a window has marginalised are not known.
  std::shared_ptr<const KeyframeCovariances> covariances(const MapSnapshot& map) const;

  const IncrementalSolver& solver() const { return *solver_; }

 private:
  static constexpr std::uint32_t kNone = static_cast<std::uint32_t>(-1);

  // An observation of the map and its index in the solver; kNone once it was marginalised.
  struct View {
    Observation seen;
    std::uint32_t in_solver = kNone;
  };
  struct KnownLandmark {
    std::uint32_t point = kNone;
    std::vector<View> views;
  };

  // A keyframe's odometry as an edge of the solver; kNone where the map holds all of it already,
  // and once it was marginalised.
  struct KnownOdometry {
    std::shared_ptr<const Odometry> odometry;
    double share = 0;  // of its information that the edge has
    std::uint32_t edge = kNone;
    bool marginalized = false;
  };

  void take_in_keyframes(const MapSnapshot& map, KeyframeId last);
  void let_keyframes_go(const MapSnapshot& map);
  void follow_moves(const MapSnapshot& map);
  double off_by(const Keyframe& keyframe) const;
  static double distance(const Rigid3d& a, const Rigid3d& b);
  bool stayed(const Keyframe& keyframe) const;
  void take_in_loops(const MapSnapshot& map);
  void fetch(const MapSnapshot& map, std::span<const LandmarkId> ids, std::size_t at) const;
  bool is_news(const MapSnapshot& map, LandmarkId id) const;
  void take_in_landmark(const MapSnapshot& map, LandmarkId id);
  void take_in_odometry(const MapSnapshot& map);
  void take_in_odometry(const MapSnapshot& map, KeyframeId id);
  bool sees_the_same(const MapSnapshot& map, KeyframeId id) const;
  std::uint32_t add_observation(const MapSnapshot& map, std::uint32_t point,
                                const Observation& seen);
  void set_outliers_aside(const MapSnapshot& map, KeyframeId newest, BundleResult& result);
  void write(const MapSnapshot& map, const std::vector<KeyframeId>& keyframes,
             std::vector<LandmarkId> seen, BundleResult& result);
  void write_estimate(const MapSnapshot& map, const std::vector<std::uint32_t>& moved,
                      std::span<const KeyframeId> newest, bool all, BundleResult& result);
  void forget_marginalized(const MapSnapshot& map, const std::vector<std::uint32_t>& poses);

  MapSmootherOptions options_;
  std::unique_ptr<IncrementalSolver> solver_;
  std::shared_ptr<const MapSnapshot> known_map_;  // as of the last update
  std::size_t camera_count_ = 0;
  std::vector<std::uint32_t> pose_of_;   // by keyframe
  std::vector<KeyframeId> keyframe_of_;  // by pose
  std::vector<Rigid3d> told_;            // by pose: where the map has it once results are taken in
  std::vector<KeyframeId> gone_;         // keyframes whose poses the solver has still
  std::vector<std::uint32_t> behind_;    // poses of which the map has yet to be told; ascending
  std::vector<LandmarkId> doubted_;      // whose views the last update set aside; ascending
  PagedTable<KnownLandmark> landmarks_;  // by id
  std::unordered_map<KeyframeId, KnownOdometry> odometry_;
  std::vector<PoseConstraint> new_loops_;
};

}  // namespace hybrid_slam
