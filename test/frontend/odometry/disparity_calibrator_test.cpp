#include "frontend/odometry/disparity_calibrator.h"

#include <catch2/catch.hpp>

#include "test/frontend/pose/pose_scene.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

struct Pair {
  StereoFeatures previous;
  StereoFeatures current;
  StereoMotion motion;
};

void append(const Eigen::Vector3d& measured, double noise, double offset, Random& random,
            StereoFeatures& features) {
  Keypoint keypoint;
  keypoint.x = static_cast<float>(measured[0] + noise * random.gaussian());
  keypoint.y = static_cast<float>(measured[1] + noise * random.gaussian());
  keypoint.sigma = 0.5F;
  features.left.keypoints.push_back(keypoint);
  features.u_right.push_back(static_cast<float>(measured[2] + offset + noise * random.gaussian()));
}

// Two frames of a camera that moves by `motion`; u_right is measured too large by `offset` [px].
Pair make_pair(const Rigid3d& motion, double offset, Random& random, double nearest = 4,
               double farthest = 40) {
  const auto camera = pose_scene::stereo();
  Pair pair;
  pair.motion.current_from_previous = motion;
  for (int tries = 0; tries < 400; ++tries) {
    const Eigen::Vector3d point(random.uniform(-10, 10), random.uniform(-3, 3),
                                random.uniform(nearest, farthest));
    const Eigen::Vector3d moved = motion * point;
    Eigen::Vector3d before, after;
    if (!RectifiedStereo::project(camera.params.data(), point.data(), before.data()) ||
        !RectifiedStereo::project(camera.params.data(), moved.data(), after.data())) {
      continue;
    }
    const int index = static_cast<int>(pair.motion.inliers.size());
    pair.motion.inliers.push_back({index, index});
    append(before, 0.2, offset, random, pair.previous);
    append(after, 0.2, offset, random, pair.current);
  }
  return pair;
}

Rigid3d forward() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitY())), {0.05, 0, -1.2}};
}

DisparityCalibrator calibrated(const Rigid3d& motion, double offset, std::uint64_t seed,
                               int pairs = 20) {
  Random random(seed);
  DisparityCalibrator calibrator(pose_scene::stereo(), {});
  for (int i = 0; i < pairs; ++i) {
    const Pair pair = make_pair(motion, offset, random);
    calibrator.add(pair.previous, 0, pair.current, 0, pair.motion);
  }
  return calibrator;
}

}  // namespace

TEST_CASE("An offset of the disparities is found within its standard deviation") {
  for (const double offset : {-0.3, 0.15, 0.4}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const DisparityCalibrator calibrator = calibrated(forward(), offset, seed);
      CHECK(calibrator.sigma() < 0.03);
      CHECK(std::abs(calibrator.offset() - offset) < 3.5 * calibrator.sigma());
    }
  }
}

TEST_CASE("Without an offset none is used") {
  int used = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    used += calibrated(forward(), 0, seed, 5).offset() != 0 ? 1 : 0;
  }
  CHECK(used <= 1);
}

TEST_CASE("A camera that stands still tells nothing of the offset") {
  const DisparityCalibrator calibrator = calibrated(Rigid3d(), 0.4, 3);
  CHECK(calibrator.offset() == 0);
  CHECK(calibrator.sigma() > 0.15);
}

TEST_CASE("Over flat ground noise is not taken for an offset") {
  // Temporal matches are noisier than disparities, which the sigmas do not tell.
  const Rigid3d sideways(Eigen::Quaterniond::Identity(), {-0.4, 0.1, 0});
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    DisparityCalibrator calibrator(pose_scene::stereo(), {});
    for (int i = 0; i < 50; ++i) {
      Pair pair = make_pair(sideways, 0, random, 4.7, 5.3);
      for (std::size_t k = 0; k < pair.current.u_right.size(); ++k) {
        const auto shift = static_cast<float>(0.4 * random.gaussian());
        pair.current.left.keypoints[k].x += shift;
        pair.current.u_right[k] += shift;  // the disparity stays
      }
      calibrator.add(pair.previous, 0, pair.current, 0, pair.motion);
    }
    CHECK(calibrator.offset() == 0);
  }
}

TEST_CASE("What was already subtracted is accounted for") {
  Random random(9);
  DisparityCalibrator calibrator(pose_scene::stereo(), {});
  for (int i = 0; i < 20; ++i) {
    Pair pair = make_pair(forward(), 0.3, random);
    for (float& u_right : pair.previous.u_right) u_right -= 0.1F;
    for (float& u_right : pair.current.u_right) u_right -= 0.25F;
    calibrator.add(pair.previous, 0.1, pair.current, 0.25, pair.motion);
  }
  CHECK(calibrator.offset() == Approx(0.3).margin(3.5 * calibrator.sigma()));
}

}  // namespace hybrid_slam
