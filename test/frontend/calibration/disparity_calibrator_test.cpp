#include "frontend/calibration/disparity_calibrator.h"

#include <catch2/catch.hpp>

#include "test/frontend/pose/pose_scene.h"
#include "test/support/filled_map.h"
#include "test/support/random.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {
namespace {

// Standard deviations [px]: of the place in the left image, of the disparity.
struct Noise {
  double place = 0.2;
  double disparity = 0.2;
};

Eigen::Vector3d measured(const Eigen::Vector3d& exact, const Noise& noise, double offset,
                         Random& random) {
  const double u = exact[0] + noise.place * random.gaussian();
  const double disparity = exact[0] - exact[2] + noise.disparity * random.gaussian();
  return {u, exact[1] + noise.place * random.gaussian(), u - disparity + offset};
}

struct Ground {
  double nearest = 4;
  double farthest = 40;
};

// Two frames of a camera that moves by `motion`; u_right is measured too large by `offset` [px].
// What keypoints claim to be good for is 0.5 px.
std::vector<StereoSight> make_pair(const Rigid3d& motion, double offset, Random& random,
                                   const Noise& noise = {}, const Ground& ground = {}) {
  const auto camera = pose_scene::stereo();
  std::vector<StereoSight> sights;
  for (int tries = 0; tries < 400; ++tries) {
    const Eigen::Vector3d point(random.uniform(-10, 10), random.uniform(-3, 3),
                                random.uniform(ground.nearest, ground.farthest));
    const Eigen::Vector3d moved = motion * point;
    Eigen::Vector3d before, after;
    if (!RectifiedStereo::project(camera.params.data(), point.data(), before.data()) ||
        !RectifiedStereo::project(camera.params.data(), moved.data(), after.data())) {
      continue;
    }
    sights.push_back({measured(before, noise, offset, random),
                      measured(after, noise, offset, random), 0.25, 0.25});
  }
  return sights;
}

Rigid3d forward() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.01, Eigen::Vector3d::UnitY())), {0.05, 0, -1.2}};
}

DisparityCalibrator calibrator() { return {CameraId(0), pose_scene::stereo(), {}}; }

DisparityCalibrator calibrated(const Rigid3d& motion, double offset, std::uint64_t seed,
                               int pairs = 20, const Noise& noise = {}) {
  Random random(seed);
  DisparityCalibrator result = calibrator();
  for (int i = 0; i < pairs; ++i) result.add(make_pair(motion, offset, random, noise), motion);
  return result;
}

// Of a corridor whose pair measures u_right too large by `offset`, of which `taken_out` is gone.
FilledMap corridor(double offset, const std::vector<double>& taken_out) {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kCorridor;
  options.times = static_cast<int>(taken_out.size());
  options.noise = 0.05;
  SyntheticScene scene = make_synthetic_scene(options);
  for (std::size_t i = 0; i < scene.frames.size(); ++i) {
    auto frame = std::make_shared<FrameObservations>(*scene.frames[i].observations);
    frame->disparity_offset = taken_out[i];
    for (float& u_right : frame->u_right) u_right += static_cast<float>(offset - taken_out[i]);
    scene.frames[i].observations = frame;
  }
  return fill_map(scene, {});
}

}  // namespace

TEST_CASE("An offset of the disparities is found within its standard deviation") {
  for (const double offset : {-0.3, 0.15, 0.4}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const DisparityCalibrator found = calibrated(forward(), offset, seed);
      CHECK(found.sigma() < 0.03);
      CHECK(std::abs(found.offset() - offset) < 3.5 * found.sigma());
    }
  }
}

TEST_CASE("Whatever noise places and disparities have, the offset is found") {
  for (const Noise noise : {Noise{0.8, 0.05}, Noise{0.1, 0.5}}) {
    double squared = 0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      const DisparityCalibrator found = calibrated(forward(), 0.3, seed, 20, noise);
      CHECK(found.sigma() < 0.06);
      const double off = (found.estimate().value_now() - 0.3) / found.sigma();
      squared += off * off / 10;
    }
    CHECK(squared < 2.3);  // chi2 of 10 degrees of freedom: once in a hundred
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
  const DisparityCalibrator found = calibrated(Rigid3d(), 0.4, 3);
  CHECK(found.offset() == 0);
  CHECK(found.sigma() > 0.15);
}

TEST_CASE("Over flat ground noise is not taken for an offset") {
  const Rigid3d sideways(Eigen::Quaterniond::Identity(), {-0.4, 0.1, 0});
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Random random(seed);
    DisparityCalibrator found = calibrator();
    for (int i = 0; i < 50; ++i) {
      found.add(make_pair(sideways, 0, random, {0.4, 0.2}, {4.7, 5.3}), sideways);
    }
    CHECK(found.offset() == 0);
  }
}

TEST_CASE("Keyframes of a map tell of the offset, whatever was taken out of them") {
  std::vector<double> taken_out(20, 0.03);
  std::fill(taken_out.begin() + 8, taken_out.end(), 0.08);
  const FilledMap filled = corridor(0.1, taken_out);
  const auto& camera = std::get<Calibrated<RectifiedStereo>>(filled.map.view().camera(CameraId(0)));
  DisparityCalibrator found(CameraId(0), camera, {});
  found.follow(filled.map.view());
  CHECK(found.sigma() < 0.04);
  CHECK(found.offset() == Approx(0.1).margin(3.5 * found.sigma()));
  const double then = found.sigma();
  found.follow(filled.map.view());  // nothing is counted twice
  CHECK(found.sigma() == then);
}

TEST_CASE("Keyframes of other runs tell nothing") {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kCorridor;
  const FilledMap filled = fill_map(make_synthetic_scene(options), {});
  const auto& camera = std::get<Calibrated<RectifiedStereo>>(filled.map.view().camera(CameraId(0)));
  DisparityCalibrator found(CameraId(0), camera, {});
  found.follow(filled.map.view());
  CHECK_FALSE(found.estimate().found());
}

}  // namespace hybrid_slam
