#include "frontend/odometry/stereo_odometer.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>

#include <Eigen/Cholesky>

#include <catch2/catch.hpp>

#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"
#include "frontend/features/sift.h"
#include "frontend/input/image_sequence.h"
#include "test/frontend/pose/pose_scene.h"
#include "test/support/stereo_frame.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {
namespace {

StereoFeatures extract(const ImageSequence& sequence, SiftExtractor& sift, std::size_t frame) {
  const FrameImages images = sequence.read(frame);
  const ImagePyramid left(images.left), right(images.right);
  return match_stereo(sift.extract(images.left, nullptr), sift.extract(images.right, nullptr),
                      &left, &right, sequence.info().stereo, {});
}

// Errors of the motion from each frame to the next, from `first` to `last`.
struct MotionErrors {
  std::vector<double> translation;  // [m]
  std::vector<double> rotation;     // [rad]
  std::vector<double> length_ratio;
  std::vector<double> inliers;
  int failures = 0;
};

double median(std::vector<double> values) {
  REQUIRE_FALSE(values.empty());
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

MotionErrors run(const ImageSequence& sequence, std::size_t first, std::size_t last) {
  REQUIRE(sequence.info().truth.size() > last);
  const StereoOdometer odometer(sequence.info().stereo, {});
  const auto sift = make_sift({});
  MotionErrors errors;
  StereoFeatures previous = extract(sequence, *sift, first);
  for (std::size_t i = first + 1; i <= last; ++i) {
    StereoFeatures current = extract(sequence, *sift, i);
    const Rigid3d truth = inverse(sequence.info().truth[i].world_from_cam) *
                          sequence.info().truth[i - 1].world_from_cam;
    const auto motion = odometer.estimate(previous, current);
    if (motion) {
      const Rigid3d error = motion->current_from_previous * inverse(truth);
      errors.translation.push_back(error.translation().norm());
      errors.rotation.push_back(pose_scene::rotation_error(error, Rigid3d()));
      errors.length_ratio.push_back(motion->current_from_previous.translation().norm() /
                                    truth.translation().norm());
      errors.inliers.push_back(static_cast<double>(motion->inliers.size()));
      CHECK(motion->matches >= static_cast<int>(motion->inliers.size()));
    } else {
      ++errors.failures;
    }
    previous = std::move(current);
  }
  return errors;
}

// None, and a line that says so, where the shared data are not at hand.
std::unique_ptr<ImageSequence> open(const char* path, const char* name) {
  const char* data = std::getenv("HYBRID_SLAM_DATA");
  if (data == nullptr || *data == '\0') {
    std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
    return nullptr;
  }
  return open_sequence(std::string(data) + path, SequenceLayout::kAuto, name);
}

TEST_CASE("stereo odometer follows a car", "[odometry]") {
  const auto sequence = open("/kitti", "s1");
  if (!sequence) return;
  const MotionErrors errors = run(*sequence, 20, 28);
  CHECK(errors.failures == 0);
  CHECK(median(errors.translation) < 0.015);
  CHECK(median(errors.rotation) < 0.001);
  CHECK(std::abs(median(errors.length_ratio) - 1) < 0.01);
  CHECK(median(errors.inliers) > 100);
}

TEST_CASE("stereo odometer follows a hovering vehicle", "[odometry]") {
  const auto sequence = open("/uwsynth/hybrid", "H1");
  if (!sequence) return;
  const MotionErrors errors = run(*sequence, 0, 8);
  CHECK(errors.failures == 0);
  CHECK(median(errors.translation) < 0.0005);
  CHECK(median(errors.rotation) < 0.0004);
  CHECK(median(errors.inliers) > 250);
}

TEST_CASE("stereo odometer gives up on frames without features", "[odometry]") {
  const StereoOdometer odometer(pose_scene::stereo(), {});
  CHECK_FALSE(odometer.estimate({}, {}));
  CHECK_THROWS_AS(StereoOdometer(pose_scene::stereo(), {.min_inliers = 1}), std::invalid_argument);
}

// Mean normalised squared error per degree of freedom of one motion per scene, over 60 scenes: 1
// with a standard deviation of 0.075.
double mean_normalized_error(SyntheticSceneOptions scene_options) {
  constexpr int kRuns = 60;
  scene_options.times = 5;
  double sum = 0;
  for (int run = 0; run < kRuns; ++run) {
    scene_options.seed = static_cast<std::uint64_t>(100 + run);
    const SyntheticScene scene = make_synthetic_scene(scene_options);
    const StereoOdometer odometer(std::get<Calibrated<RectifiedStereo>>(scene.cameras[0]), {});
    const SyntheticFrame& previous = scene.frames[3];
    const SyntheticFrame& current = scene.frames[4];
    const auto motion = odometer.estimate(stereo_features(*previous.observations),
                                          stereo_features(*current.observations));
    REQUIRE(motion);
    const Rigid3d truth = current.cam_from_world * inverse(previous.cam_from_world);
    const Vector6d off = se3_log(truth * inverse(motion->current_from_previous));
    sum += squared_mahalanobis(off, motion->covariance) / 6;
  }
  return sum / kRuns;
}

TEST_CASE("A motion is off by what its covariance says where coarse keypoints are less certain") {
  struct Case {
    SceneTrajectory trajectory;
    int landmarks;
    double noise;
  };
  // With one variance for all keypoints and nothing said of the threshold: 1.4 to 3.2.
  for (const Case& c :
       {Case{SceneTrajectory::kCorridor, 300, 0.1}, Case{SceneTrajectory::kCorridor, 300, 0.25},
        Case{SceneTrajectory::kCorridor, 2000, 0.1}, Case{SceneTrajectory::kCorridor, 2000, 0.25},
        Case{SceneTrajectory::kHover, 300, 0.1}, Case{SceneTrajectory::kHover, 2000, 0.1},
        Case{SceneTrajectory::kHover, 2000, 0.25}}) {
    SyntheticSceneOptions options;
    options.trajectory = c.trajectory;
    options.landmarks = c.landmarks;
    options.noise = c.noise;
    options.clutter = 50;
    INFO("trajectory " << static_cast<int>(c.trajectory) << ", " << c.landmarks
                       << " landmarks, noise " << c.noise);
    const double mean = mean_normalized_error(options);
    CHECK(mean > 0.8);
    CHECK(mean < 1.35);
  }
}

}  // namespace
}  // namespace hybrid_slam
