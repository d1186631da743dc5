// Whether each frame that the map holds is where it says it is: pose_covariance_test asks for
// means.
#include <algorithm>

#include <catch2/catch.hpp>

#include "apps/slam/frame_figures.h"
#include "test/integration/simulated_runs.h"

namespace hybrid_slam {
namespace {

struct FarFrames {
  int map = 0;  // frames in this state whose pose is in the component of the origin
  int far = 0;  // of them: farther off than three sigma and a centimetre
};

// At the moment they were told: what a loop takes out later was off until then.
void count_far(const SimulatedSource& source, FarFrames& count) {
  ReplayHooks hooks;
  hooks.frame = [&](const FrameResult& frame) {
    if (frame.state != TrackingState::kMap || frame.component != KeyframeId(0)) return;
    const auto index = static_cast<std::size_t>(frame.index);
    const SyntheticFrame& truth = frame.camera == CameraKind::kStereo ? source.stereo_truth(index)
                                                                      : source.fisheye_truth(index);
    const PoseFigures told = pose_figures(frame.tracked);
    const Eigen::Vector3d off =
        told.world_from_cam.translation() - origin_in_a(truth.cam_from_world);
    ++count.map;
    count.far += off.norm() > std::max(0.01, 3 * told.sigma_position) ? 1 : 0;
  };
  run_every_frame(source, simulated_options(), simulated_run(source), hooks);
}

// Two laps of 18.85 m: open tracks that drift, and their way back over known ground. One scene in
// three has wrong matches, one in three is blind for 1.5 s. The noise is that of positions aligned
// by patches, of which maps of images are made. With the noise of keypoints, four times as much,
// distances come out 0.1 to 0.8 % short, which covariances do not say: docs/benchmarks.md.
SimulatedSource two_laps(std::uint64_t seed) {
  SyntheticSceneOptions options = orbit_of(2 * kOrbitFrames);
  options.seed = seed;
  options.noise = 0.06;
  if (seed % 3 == 1) options.outlier_rate = 0.1;
  SimulatedSource source(make_synthetic_scene(options));
  const std::size_t dark = 20 + seed;
  for (std::size_t i = dark; seed % 3 == 2 && i < dark + 15; ++i) source.blank.insert(i);
  return source;
}

}  // namespace

TEST_CASE("Of five thousand frames that the map holds at most one is far from where it says it is",
          "[integration][slow]") {
  FarFrames count;
  for (std::uint64_t seed = 1; count.map < 5000; ++seed) count_far(two_laps(seed), count);
  CHECK(count.far <= 1);
}

}  // namespace hybrid_slam
