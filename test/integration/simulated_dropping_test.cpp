// Keyframes that are out of use drop what has neither a landmark nor a right match: what that
// saves, and that nothing else changes.
#include <malloc.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "frontend/place_recognition/keyframe_database.h"
#include "test/integration/simulated_runs.h"

namespace hybrid_slam {
namespace {

SlamOptions with_full_keyframes(SlamOptions options, int count) {
  options.culling.full_keyframes = count;
  return options;
}

std::size_t stored_features(const MapSnapshot& map) {
  std::size_t count = 0;
  for (const KeyframeId id : map.keyframe_ids()) count += map.at(id).observations->size();
  return count;
}

std::size_t closed(const RunResult& result) {
  return static_cast<std::size_t>(
      std::count_if(result.loops.begin(), result.loops.end(),
                    [](const LoopRecord& loop) { return loop.outcome == kLoopAccepted; }));
}

// A lap and a third, at whose end the map is off; what is farther than a few keyframes is not seen.
SimulatedSource drifting_lap(std::uint64_t seed) {
  SyntheticSceneOptions options = orbit_of(78);
  options.noise = 0.5;
  options.seed = seed;
  return SimulatedSource(make_synthetic_scene(options));
}

SlamOptions short_sighted() {
  SlamOptions options = simulated_options();
  options.tracking.local_map.max_keyframes = 8;
  options.tracking.local_map.neighbours_per_keyframe = 0;
  options.fusion.second_neighbours = 0;
  return options;
}

// How many of the scene's frames are found in a map by themselves, within what the map is off by.
int found_alone(const MapSnapshot& map, const SimulatedSource& source) {
  int found = 0;
  for (std::size_t i = 0; i < 78; i += 3) {
    SimulatedSource one(source.scene());
    one.order = {i};
    ReplayOptions run = simulated_run(source);
    run.session.localize = true;
    const RunResult result = run_every_frame(one, simulated_options(), run, {}, copy_of(map));
    if (result.frames.tracked != 1) continue;
    const Rigid3d pose = result.cam_from_world(result.records.front());
    const Rigid3d truth = source.stereo_truth(i).cam_from_world;
    found += (origin_in_a(pose) - origin_in_a(truth)).norm() < 0.25 ? 1 : 0;
  }
  return found;
}

// What the process holds of its heap: its resident memory without what waits to be used again.
double held_kb() {
  const struct mallinfo2 heap = mallinfo2();
  return static_cast<double>(heap.uordblks + heap.hblkhd) / 1024;
}

template <typename T>
double bytes(const std::vector<T>& values) {
  return static_cast<double>(values.capacity() * sizeof(T));
}

// What the map holds of each kind per keyframe [KB], without what its tables and the heap add.
std::string owners(const MapSnapshot& map) {
  double features = 0, links = 0, odometry = 0, landmarks = 0;
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    const FrameObservations& frame = *keyframe.observations;
    features += bytes(frame.features.keypoints) + bytes(frame.features.descriptors) +
                bytes(frame.u_right) + sizeof frame;
    links += sizeof keyframe + bytes(keyframe.landmarks) + bytes(keyframe.covisible) +
             bytes(keyframe.children);
    if (keyframe.odometry) odometry += sizeof(Odometry) + bytes(keyframe.odometry->keypoints);
  }
  for (const LandmarkId id : map.landmark_ids()) {
    landmarks += sizeof(Landmark) + bytes(map.at(id).observations);
  }
  const double each = 1024 * static_cast<double>(map.keyframe_count());
  return "features " + std::to_string(features / each) + ", keyframes " +
         std::to_string(links / each) + ", odometry " + std::to_string(odometry / each) +
         ", landmarks " + std::to_string(landmarks / each);
}

// A corridor of which every frame becomes a keyframe, with 1000 features each. Growth of what
// the process holds over the second half [KB per keyframe]. Local bundle adjustment holds nothing
// from keyframe to keyframe, so that this is the map's, the words' and the books'.
double growth(const SimulatedSource& source, int full_keyframes, RunResult& result) {
  result = {};  // of a run before: held until now
  SlamOptions options = with_full_keyframes(simulated_options(), full_keyframes);
  options.tracking.keyframes.max_frames_between = 1;
  options.culling.redundancy.observers = 1000;
  options.backend.local_method = LocalMethod::kBundle;
  options.backend.local.max_neighbours = 3;
  options.backend.local.max_fixed = 5;
  double from = 0;
  std::size_t keyframes = 0;
  ReplayHooks hooks;
  hooks.progress = [&](const ReplayProgress& progress) {
    if (keyframes > 0 || 2 * progress.done < progress.total) return;
    keyframes = progress.keyframes;
    from = held_kb();
  };
  result = run_every_frame(source, options, simulated_run(source), hooks);
  const std::size_t more = result.map->keyframe_count() - keyframes;
  REQUIRE(more > source.size() / 3);
  return (held_kb() - from) / static_cast<double>(more);
}

}  // namespace

TEST_CASE("Loops are closed and frames found as if no feature had been dropped",
          "[integration][slow]") {
  double error = 0, error_whole = 0;
  int found = 0, found_whole = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const SimulatedSource source = drifting_lap(seed);
    const ReplayOptions run = simulated_run(source);
    const RunResult whole =
        run_every_frame(source, with_full_keyframes(short_sighted(), 0), run, {});
    const RunResult dropped =
        run_every_frame(source, with_full_keyframes(short_sighted(), 10), run, {});
    CAPTURE(seed);
    CHECK(20 * stored_features(*dropped.map) < 19 * stored_features(*whole.map));
    CHECK(closed(dropped) == closed(whole));
    CHECK(dropped.frames.tracked == whole.frames.tracked);
    CHECK(faults_of(*dropped.map) == "");
    error += rms_position_error(dropped, source);
    error_whole += rms_position_error(whole, source);
    found += found_alone(*dropped.map, source);
    found_whole += found_alone(*whole.map, source);
    WARN("seed " << seed << ": features " << stored_features(*whole.map) << " -> "
                 << stored_features(*dropped.map) << ", loops " << closed(whole) << " -> "
                 << closed(dropped) << ", error [m] " << rms_position_error(whole, source) << " -> "
                 << rms_position_error(dropped, source) << ", found " << found_whole << " -> "
                 << found);
  }
  CHECK(error < 1.05 * error_whole);
  CHECK(found >= found_whole);
}

TEST_CASE("A keyframe costs the process what its useful features cost", "[integration][slow]") {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kCorridor;
  options.times = 200;
  options.step = 3;
  options.landmarks = 6000;
  options.clutter = 600;
  const SimulatedSource source(make_synthetic_scene(options));
  RunResult result;
  const double dropped = growth(source, 10, result);
  KeyframeDatabase places(simulated_run(source).session.vocabulary);
  const std::string table = owners(*result.map);
  const std::size_t stored = stored_features(*result.map) / result.map->keyframe_count();
  const double whole = growth(source, 0, result);
  const double before = held_kb();
  places.follow(*result.map);
  const double words = (held_kb() - before) / static_cast<double>(result.map->keyframe_count());
  WARN("KB per keyframe: " << whole << " -> " << dropped << " with " << stored
                           << " features; of these " << table << "; words, of all features "
                           << words);
  CHECK(dropped < 100);
  CHECK(dropped < 0.75 * whole);
}

}  // namespace hybrid_slam
