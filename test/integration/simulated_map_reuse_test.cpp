// Places found again: after the camera was blind, and in maps of runs before.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "frontend/calibration/rig_calibrator.h"
#include "test/integration/simulated_runs.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kBlind = 30;   // frames: 3 s
constexpr std::size_t kInTime = 20;  // frames: 2 s

struct Kidnapping {
  bool found = false;     // in time
  std::size_t after = 0;  // frames
  double error = 0;       // [m] of the first pose then
  double map_error = 0;   // [m] of the last pose before
  std::string faults;     // of the map
};

// The camera is blind for a while in the middle of its way, and then is at an earlier place.
Kidnapping kidnap(std::uint64_t seed) {
  SyntheticSceneOptions options = orbit_of(36);
  options.landmarks = 3000;
  options.noise = 0.15;
  options.seed = seed;
  SimulatedSource source(make_synthetic_scene(options));
  Random random(1000 + seed);
  const std::size_t flown = 18 + random.below(18);
  const std::size_t back = random.below(flown - 10);
  for (std::size_t i = 0; i < flown; ++i) source.order.push_back(i);
  for (std::size_t i = 0; i < kBlind; ++i) {
    source.blank.insert(source.order.size());
    source.order.push_back(0);
  }
  const std::size_t first = source.order.size();
  for (std::size_t i = 0; i < kInTime; ++i) {  // goes on from there, and stays where that ends
    source.order.push_back(std::min(back + i, std::size_t{35}));
  }
  const RunResult result = run_every_frame(source, simulated_options(), simulated_run(source), {});
  Kidnapping kidnapping;
  kidnapping.faults = faults_of(*result.map);
  kidnapping.map_error = position_error(result, source, flown - 1);
  for (std::size_t i = first; i < first + kInTime && !kidnapping.found; ++i) {
    if (!result.records.at(i).frame.tracked()) continue;
    kidnapping.found = true;
    kidnapping.after = i - first;
    kidnapping.error = position_error(result, source, i);
  }
  return kidnapping;
}

void check_kidnappings(std::uint64_t first, std::uint64_t count) {
  std::uint64_t found = 0;
  double worst = 0;
  std::size_t latest = 0;
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    const Kidnapping one = kidnap(seed);
    CAPTURE(seed, one.found, one.after, one.error, one.map_error);
    CHECK(one.faults == "");
    if (!one.found) continue;
    CHECK(one.error < 0.02);
    ++found;
    worst = std::max(worst, one.error);
    latest = std::max(latest, one.after);
  }
  INFO("found " << found << " of " << count << ", worst error " << worst << " m, latest after "
                << latest << " frames");
  CHECK(100 * found >= 95 * count);
}

// Hovering, seen by two runs: of even and of odd moments.
SimulatedSource hover(std::size_t start) {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kHover;
  options.times = 60;
  options.landmarks = 3000;
  options.noise = 0.15;
  options.clutter = 100;
  SimulatedSource source(make_synthetic_scene(options));
  for (std::size_t i = start; i < 60; i += 2) source.order.push_back(i);
  return source;
}

RunResult first_run() {
  const SimulatedSource source = hover(0);
  return run_every_frame(source, simulated_options(), simulated_run(source), {});
}

// No two frames of a map have one camera and one index.
bool frames_differ(const MapSnapshot& map) {
  std::set<std::pair<CameraId, std::int64_t>> frames;
  for (const KeyframeId id : map.keyframe_ids()) {
    const FrameObservations& frame = *map.at(id).observations;
    if (!frames.emplace(frame.camera, frame.frame_index).second) return false;
    if (map.find_frame(frame.camera, frame.frame_index) != &map.at(id)) return false;
  }
  return true;
}

}  // namespace

TEST_CASE("A kidnapped camera is found at the place where it is", "[integration]") {
  check_kidnappings(1, 5);
}

TEST_CASE("Of twenty kidnapped cameras nineteen are found", "[integration][slow]") {
  check_kidnappings(101, 20);
}

TEST_CASE("A second run goes on with the map of the first", "[integration]") {
  const RunResult a = first_run();
  const SimulatedSource source = hover(1);
  for (const bool realtime : {false, true}) {
    const auto run_b = realtime ? run_realtime : run_every_frame;
    const RunResult b =
        run_b(source, simulated_options(), simulated_run(source), {}, copy_of(*a.map));
    CHECK(b.frames.tracked == 30);
    CHECK(b.records.front().frame.source == PoseSource::kRelocalization);
    CHECK(b.map->camera_count() == a.map->camera_count());
    CHECK(b.map->origin() == a.map->origin());
    CHECK(b.map->next_keyframe_id() >= a.map->next_keyframe_id());
    for (const FrameRecord& record : b.records) {
      if (record.keyframe) CHECK(*record.keyframe >= a.map->next_keyframe_id());
      CHECK(record.frame.frame_index > a.map->newest_frame_index(CameraId(0)));
    }
    CHECK(frames_differ(*b.map));
    CHECK(max_position_error(b, source) < 0.01);
    CHECK(faults_of(*b.map) == "");
  }
}

TEST_CASE("Localising tracks every frame and leaves the map as it was", "[integration]") {
  const RunResult a = first_run();
  const SimulatedSource source = hover(1);
  ReplayOptions run = simulated_run(source);
  run.session.localize = true;
  for (const bool realtime : {false, true}) {
    const auto run_c = realtime ? run_realtime : run_every_frame;
    const RunResult c = run_c(source, simulated_options(), run, {}, copy_of(*a.map));
    CHECK(c.frames.tracked == 30);
    CHECK(max_position_error(c, source) < 0.01);
    CHECK(c.loops.empty());
    CHECK(bytes_of(*c.map) == bytes_of(*a.map));
    for (const FrameRecord& record : c.records) {
      CHECK_FALSE(record.keyframe);
      CHECK(record.frame.frame_index > a.map->newest_frame_index(CameraId(0)));
    }
  }
}

// A corridor, seen by a pair whose disparities are `offset` [px] too small: of even and odd
// moments.
SimulatedSource corridor(std::size_t start, float offset) {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kCorridor;
  options.times = 60;
  options.step = 0.2;
  options.noise = 0.05;
  SyntheticScene scene = make_synthetic_scene(options);
  for (SyntheticFrame& frame : scene.frames) {
    auto seen = std::make_shared<FrameObservations>(*frame.observations);
    for (float& u_right : seen->u_right) u_right += offset;
    frame.observations = std::move(seen);
  }
  SimulatedSource source(std::move(scene));
  for (std::size_t i = start; i < 60; i += 2) source.order.push_back(i);
  return source;
}

// `first_offset`: what was taken out of the first frame's disparities [px].
RunResult run_with(const SimulatedSource& source, bool localize, Map map,
                   std::optional<double>& first_offset) {
  ReplayOptions run = simulated_run(source);
  run.session.localize = localize;
  ReplayHooks hooks;
  hooks.frame = [&](const FrameResult& frame) {
    if (!first_offset) first_offset = frame.tracked.disparity_offset;
  };
  return run_every_frame(source, simulated_options(), run, hooks, std::move(map));
}

RunResult run_with(const SimulatedSource& source, bool localize, Map map = {}) {
  std::optional<double> first_offset;
  return run_with(source, localize, std::move(map), first_offset);
}

TEST_CASE("A second run begins with what the first has found of its rig", "[integration]") {
  constexpr float kOffset = 0.5F;  // some 3 % of the scale
  std::optional<double> first_offset;
  const RunResult a = run_with(corridor(0, kOffset), false, {}, first_offset);
  CHECK(first_offset == 0);
  const auto found = a.map->correction(CameraId(0)).disparity;
  REQUIRE(found);
  // The few keyframes of 30 frames were judged with less of it in use, which hides some of it.
  CHECK(found->in_use == Approx(kOffset).margin(0.1));
  CHECK(std::abs(found->value - kOffset) < 4 * std::hypot(found->sigma, found->systematic));
  for (const bool localize : {false, true}) {
    CAPTURE(localize);
    first_offset.reset();
    const RunResult b = run_with(corridor(1, kOffset), localize, copy_of(*a.map), first_offset);
    CHECK(first_offset == found->in_use);
    CHECK(b.disparity_offset == Approx(kOffset).margin(0.03));
    CHECK(b.rig->of_map.disparity == found);
    CHECK_FALSE(b.rig->changed.disparity);
    CHECK(b.frames.tracked == 30);
    CHECK(faults_of(*b.map) == "");
    const auto later = b.map->correction(CameraId(0)).disparity;
    REQUIRE(later);
    if (localize) CHECK(*later == *found);
    if (!localize) CHECK(later->sigma < found->sigma);
  }
}

// By how much u_right of what both maps have of a keyframe is larger in `b`, on average [px].
double shift_between(const MapSnapshot& a, const MapSnapshot& b) {
  double sum = 0, count = 0;
  for (const KeyframeId id : a.keyframe_ids()) {
    if (b.find(id) == nullptr) continue;
    const FrameObservations& then = *a.at(id).observations;
    const FrameObservations& now = *b.at(id).observations;
    for (std::size_t i = 0, j = 0; i < then.size() && j < now.size(); ++i) {
      if (then.features.keypoints[i].x != now.features.keypoints[j].x) continue;  // dropped
      if (now.has_right(j)) sum += now.u_right[j] - then.u_right[i], ++count;
      ++j;
    }
  }
  return sum / count;
}

TEST_CASE("A rig that was repaired between two runs is not as the map says", "[integration]") {
  const RunResult a = run_with(corridor(0, 0.5F), false);
  const RunResult b = run_with(corridor(1, 0), false, copy_of(*a.map));
  CHECK(b.rig->changed.disparity);
  CHECK(std::abs(b.disparity_offset) < 0.03);
  const auto found = b.map->correction(CameraId(0)).disparity;
  REQUIRE(found);
  CHECK(std::abs(found->value) < 0.03);
  CHECK(faults_of(*b.map) == "");
  // The first run's keyframes keep what was right for them.
  CHECK(shift_between(*a.map, *b.map) == 0);
  CHECK(max_position_error(b, corridor(1, 0)) < 0.1);
}

TEST_CASE("A run with another camera adds it to the map", "[integration]") {
  const RunResult a = first_run();
  SyntheticScene scene = hover(1).scene();
  scene.cameras.front() = synthetic_stereo_camera(0.1201);
  SimulatedSource source(std::move(scene));
  source.order = hover(1).order;
  const RunResult b =
      run_every_frame(source, simulated_options(), simulated_run(source), {}, copy_of(*a.map));
  CHECK(b.map->camera_count() == 2);
  CHECK(b.frames.tracked == 30);
  CHECK(b.records.front().frame.source == PoseSource::kRelocalization);
  CHECK(max_position_error(b, source) < 0.015);
  for (const FrameRecord& record : b.records) {
    if (record.keyframe && b.map->find(*record.keyframe) != nullptr) {
      CHECK(b.map->at(*record.keyframe).observations->camera == CameraId(1));
    }
  }
  CHECK(frames_differ(*b.map));
  CHECK(faults_of(*b.map) == "");
}

}  // namespace hybrid_slam
