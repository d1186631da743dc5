#include <catch2/catch.hpp>

#include "test/integration/tracked_scene.h"

// One value per run: the errors of successive frames have the map's in common, and are not
// independent. The bounds are those of chi2 with as many runs, or those that users are promised.

namespace hybrid_slam {
namespace {

struct MeanErrors {
  double stereo = 0;  // mean over runs of the normalised error per degree of freedom
  double fisheye = 0;
  double left_from_fisheye = 0;
  int runs = 0;  // in which all is known
};

MeanErrors run_scenes(SyntheticSceneOptions options, int runs) {
  MeanErrors mean;
  for (int i = 0; i < runs; ++i) {
    options.seed = static_cast<std::uint64_t>(1 + i);
    const SyntheticScene scene = make_synthetic_scene(options);
    const TrackedMoment moment = track_scene(scene);
    if (!moment.known || moment.stereo.source != PoseSource::kLocalMap) continue;
    ++mean.runs;
    const auto* truth = &scene.frames[scene.frames.size() - scene.cameras.size()];
    const Rigid3d& left = truth[0].cam_from_world;
    const TrackedFrame& stereo = moment.stereo;
    mean.stereo += normalized_error({stereo.cam_from_world, stereo.covariance}, left) / runs;
    if (!moment.left_from_fisheye) continue;
    const Rigid3d& fish = truth[1].cam_from_world;
    const TrackedFrame& fisheye = moment.fisheye;
    mean.fisheye += normalized_error({fisheye.cam_from_world, fisheye.covariance}, fish) / runs;
    mean.left_from_fisheye +=
        normalized_error(*moment.left_from_fisheye, left * inverse(fish)) / runs;
  }
  return mean;
}

SyntheticSceneOptions hover() {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kHover;
  options.times = 12;
  options.landmarks = 1500;
  options.clutter = 50;
  options.fisheye = true;
  return options;
}

void check_between(double mean, double low, double high) {
  CHECK(mean > low);
  CHECK(mean < high);
}

// 6 degrees of freedom of 20 runs: chi2 of 120 degrees lies between 75 and 178 in 998 of 1000.
constexpr double kLow20 = 75. / 120;
constexpr double kHigh20 = 178. / 120;

}  // namespace

TEST_CASE("Poses are off by what their covariances say", "[integration]") {
  const MeanErrors mean = run_scenes(hover(), 20);
  CHECK(mean.runs == 20);
  check_between(mean.stereo, kLow20, kHigh20);
  check_between(mean.fisheye, kLow20, kHigh20);
  check_between(mean.left_from_fisheye, kLow20, kHigh20);
}

TEST_CASE("Poses of a hundred runs are off by what their covariances say", "[integration][slow]") {
  SyntheticSceneOptions options = hover();
  options.times = 20;
  const MeanErrors mean = run_scenes(options, 100);
  CHECK(mean.runs == 100);
  check_between(mean.stereo, 0.8, 1.3);
  check_between(mean.fisheye, 0.8, 1.3);
  check_between(mean.left_from_fisheye, 0.8, 1.3);
}

}  // namespace hybrid_slam
