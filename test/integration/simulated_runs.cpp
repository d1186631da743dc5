#include "test/integration/simulated_runs.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "backend/map/map_file.h"
#include "cameras/files/input_error.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {

SyntheticSceneOptions orbit_of(int times) {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kOrbit;
  options.times = times;
  options.step = 2 * std::numbers::pi * 3 / kOrbitFrames;
  options.landmarks = 4000;
  options.clutter = 100;
  return options;
}

SlamOptions simulated_options(bool loops) {
  SlamOptions options;
  options.features = 1000;
  options.loops.enabled = loops;
  options.distribute();
  return options;
}

SyntheticSceneOptions long_corridor() {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kCorridor;
  options.times = 2051;
  options.step = 3;
  options.landmarks = 60000;
  return options;
}

SlamOptions keyframe_each_frame() {
  SlamOptions options = simulated_options();
  options.features = 400;
  options.distribute();
  options.tracking.keyframes.max_frames_between = 1;
  options.culling.redundancy.observers = 1000;
  return options;
}

ReplayOptions simulated_run(const SimulatedSource& source) {
  SyntheticScene some;
  const std::size_t stride = std::max<std::size_t>(1, source.scene().frames.size() / 16);
  for (std::size_t i = 0; i < source.scene().frames.size(); i += stride) {
    some.frames.push_back(source.scene().frames[i]);
  }
  ReplayOptions run;
  run.session.vocabulary = scene_vocabulary(some);
  return run;
}

double position_error(const RunResult& result, const SimulatedSource& source, std::size_t index) {
  const Rigid3d estimate = result.cam_from_world(result.records.at(index));
  return (origin_in_a(estimate) - origin_in_a(source.stereo_truth(index).cam_from_world)).norm();
}

double rms_position_error(const RunResult& result, const SimulatedSource& source) {
  double sum = 0;
  int count = 0;
  for (std::size_t i = 0; i < result.records.size(); ++i) {
    if (!result.records[i].frame.tracked()) continue;
    sum += std::pow(position_error(result, source, i), 2);
    ++count;
  }
  return std::sqrt(sum / count);
}

double max_position_error(const RunResult& result, const SimulatedSource& source) {
  double most = 0;
  for (std::size_t i = 0; i < result.records.size(); ++i) {
    if (!result.records[i].frame.tracked()) continue;
    most = std::max(most, position_error(result, source, i));
  }
  return most;
}

std::string bytes_of(const MapSnapshot& map) {
  const TempFolder folder;
  save_map(folder.path() / "map.hslam", map, {});
  return read_text(folder.path() / "map.hslam");
}

Map copy_of(const MapSnapshot& map) {
  const TempFolder folder;
  save_map(folder.path() / "map.hslam", map, {});
  return load_map(folder.path() / "map.hslam").map;
}

std::string faults_of(const MapSnapshot& map) {
  try {
    copy_of(map);
    return {};
  } catch (const InputError& error) {
    return error.what();
  }
}

}  // namespace hybrid_slam
