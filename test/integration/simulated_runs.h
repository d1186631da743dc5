#pragma once

#include <string>

#include "backend/map/map.h"
#include "test/integration/simulated_source.h"
#include "test/support/replays.h"

namespace hybrid_slam {

// What the simulated tests of loops and of maps that are gone on with have in common.

inline constexpr int kOrbitFrames = 60;  // of one lap

// The first `times` frames of an orbit of which kOrbitFrames make a lap of 18.85 m.
SyntheticSceneOptions orbit_of(int times);

SlamOptions simulated_options(bool loops = true);

// Always onwards, for a map of 2000 keyframes and more if each frame becomes one.
SyntheticSceneOptions long_corridor();

// Each frame becomes a keyframe, and stays.
SlamOptions keyframe_each_frame();

// With a vocabulary of what is seen in the scene, of some of its frames.
ReplayOptions simulated_run(const SimulatedSource& source);

// Between the estimated and the true camera centres; both worlds are the first frame's camera. Of
// runs that read each frame of the source.
double position_error(const RunResult& result, const SimulatedSource& source, std::size_t index);
double rms_position_error(const RunResult& result, const SimulatedSource& source);
double max_position_error(const RunResult& result, const SimulatedSource& source);

// As it is saved.
std::string bytes_of(const MapSnapshot& map);

// Saved and loaded. Throws InputError if it is not consistent.
Map copy_of(const MapSnapshot& map);

// What is wrong with the map: nothing, if all its tables agree and its values are in range.
std::string faults_of(const MapSnapshot& map);

}  // namespace hybrid_slam
