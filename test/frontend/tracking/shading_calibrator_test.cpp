#include "frontend/tracking/shading_calibrator.h"

#include <catch2/catch.hpp>
#include <limits>

#include "test/support/random.h"

namespace hybrid_slam {
namespace {

Calibrated<RectifiedStereo> camera() { return {{500, 500, 319.5, 239.5, 0.15}, 640, 480}; }

// What a pair of keyframes over a seafloor is given to see.
struct Seafloor {
  double depth_per_size = 0;
  double scale_error = 0;  // share that is missing in the known translation
  double offset = 0;       // of all disparities [px]
  double wrong = 0;        // share of mismatches
  double noise = 1;        // in sigmas
};

Keypoint keypoint_at(const Eigen::Vector3d& measured, double scale, double sigma, Random& random) {
  Keypoint keypoint;
  keypoint.x = static_cast<float>(measured.x() + sigma * random.gaussian());
  keypoint.y = static_cast<float>(measured.y() + sigma * random.gaussian());
  keypoint.scale = static_cast<float>(scale);
  keypoint.sigma = static_cast<float>(std::max(sigma, 0.01));
  return keypoint;
}

// A point seen from the first keyframe and, as if it lay deeper, from the second.
ShadedTrack track_of(const Seafloor& ground, const Rigid3d& motion, Random& random) {
  const auto stereo = camera();
  const Eigen::Vector3d point(random.uniform(-0.5, 0.5), random.uniform(-0.4, 0.4),
                              random.uniform(1.3, 1.8));
  const double scale = random.uniform(1, 6);
  const double sigma = ground.noise * std::max(0.1, 0.06 * scale);
  const double deeper =
      ShadingCalibrator::relative_depth(ground.depth_per_size, scale / stereo.params[0]);
  const Eigen::Vector3d seems = motion * Eigen::Vector3d((1 + deeper) * point);
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  Eigen::Vector3d after = Eigen::Vector3d::Zero();
  REQUIRE(RectifiedStereo::project(stereo.params.data(), point.data(), before.data()));
  REQUIRE(RectifiedStereo::project(stereo.params.data(), seems.data(), after.data()));
  if (random.uniform(0, 1) < ground.wrong) after.x() += random.uniform(-20, 20);
  const Keypoint first = keypoint_at(before, scale, 0, random);
  const double u_right = before.z() - ground.offset + sigma * random.gaussian();
  const Rigid3d known(motion.rotation(), (1 - ground.scale_error) * motion.translation());
  return make_shaded_track(stereo, known, first, u_right, keypoint_at(after, scale, sigma, random),
                           point.z());
}

Rigid3d motion_of(int keyframe, Random& random) {
  return {Eigen::Quaterniond(
              Eigen::AngleAxisd(0.02 * random.gaussian(), Eigen::Vector3d(1, 1, 1).normalized())),
          Eigen::Vector3d(keyframe % 2 == 0 ? 0.3 : -0.2, 0.1, 0.02)};
}

ShadingCalibrator calibrated(const Seafloor& ground, std::uint64_t seed, int keyframes = 20,
                             ShadingCalibratorOptions options = {}, double corrected = 0,
                             int tracks_per_keyframe = 500) {
  Random random(seed);
  ShadingCalibrator calibrator(options);
  for (int k = 0; k < keyframes; ++k) {
    const Rigid3d motion = motion_of(k, random);
    std::vector<ShadedTrack> tracks;
    tracks.reserve(static_cast<std::size_t>(tracks_per_keyframe));
    for (int i = 0; i < tracks_per_keyframe; ++i)
      tracks.push_back(track_of(ground, motion, random));
    calibrator.add(tracks, corrected);
  }
  return calibrator;
}

TEST_CASE("A track tells its parallax and how much of it is missing") {
  Random random(1);
  Seafloor exact{.depth_per_size = 0.4, .noise = 0};
  const Rigid3d motion(Eigen::Quaterniond::Identity(), {0.3, 0, 0});
  for (int i = 0; i < 20; ++i) {
    const ShadedTrack track = track_of(exact, motion, random);
    const double deeper = ShadingCalibrator::relative_depth(0.4, track.size);
    CHECK(deeper > 0.0004);
    CHECK(track.lag == Approx(deeper / (1 + deeper)).margin(2e-5));  // positions are floats
    CHECK(track.parallax == Approx(2 * track.disparity));            // 0.3 m against 0.15 m
  }
  Seafloor short_motion{.scale_error = 0.01, .noise = 0};
  CHECK(track_of(short_motion, motion, random).lag == Approx(1 - 1 / 0.99).margin(2e-5));
}

TEST_CASE("The depth that lamps pretend is found beside other errors") {
  for (const double truth : {0.4, -0.3}) {
    const Seafloor ground{
        .depth_per_size = truth, .scale_error = 0.002, .offset = 0.1, .wrong = 0.1};
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      const ShadingCalibrator calibrator = calibrated(ground, seed, 60);
      CHECK(std::abs(calibrator.depth_per_size() - truth) < 3 * calibrator.sigma());
      CHECK(calibrator.sigma() < 0.055);
    }
  }
}

TEST_CASE("What is not known of the shading is told as a share of the lamps' ways") {
  constexpr double kSize = 3e-3;
  const ShadingDoubt before = ShadingCalibrator({}).doubt(kSize);
  CHECK(before.of_vehicle == ShadingCalibrator::relative_depth(1, kSize));  // as wide as the prior
  CHECK(before.of_arm == before.of_vehicle);
  const ShadingCalibrator calibrator = calibrated({.depth_per_size = 0.4}, 1, 60);
  REQUIRE(calibrator.depth_per_size() > 0.2);
  const ShadingDoubt after = calibrator.doubt(kSize);
  CHECK(after.of_vehicle < 0.1 * before.of_vehicle);
  CHECK(after.of_arm >= ShadingCalibrator::relative_depth(calibrator.depth_per_size(), kSize));
  ShadingCalibratorOptions still;
  still.enabled = false;
  CHECK(ShadingCalibrator(still).doubt(kSize).of_vehicle == 0);
  CHECK(ShadingCalibrator(still).doubt(kSize).of_arm == 0);
}

TEST_CASE("Without moving lamps nothing is corrected") {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Seafloor ground{.scale_error = 0.003, .offset = -0.15, .wrong = 0.1};
    CHECK(calibrated(ground, seed).depth_per_size() == 0);
  }
}

TEST_CASE("What was corrected already is part of the estimate") {
  const ShadingCalibrator calibrator = calibrated({.depth_per_size = 0.1}, 3, 20, {}, 0.3);
  CHECK(calibrator.depth_per_size() == Approx(0.4).margin(3 * calibrator.sigma()));
}

TEST_CASE("Too few tracks, or useless ones, teach nothing") {
  const Seafloor ground{.depth_per_size = 0.4};
  ShadingCalibratorOptions off;
  off.enabled = false;
  CHECK(calibrated(ground, 1, 20, off).depth_per_size() == 0);
  CHECK(calibrated(ground, 1, 20, {}, 0, 49).depth_per_size() == 0);
  CHECK(calibrated(ground, 1, 20, {}, 0, 50).sigma() < 1);

  ShadingCalibrator calibrator({});
  ShadedTrack useless;
  useless.lag = std::numeric_limits<double>::quiet_NaN();
  calibrator.add(std::vector<ShadedTrack>(100, useless), 0);
  ShadedTrack still{.disparity = 40, .parallax = 0, .lag = 0.1, .size = 0.002, .sigma = 0.1};
  calibrator.add(std::vector<ShadedTrack>(100, still), 0);
  CHECK(calibrator.sigma() == 1);

  ShadingCalibratorOptions wrong;
  wrong.prior_sigma = 0;
  CHECK_THROWS_WITH(ShadingCalibrator(wrong), Catch::Contains("prior_sigma"));
}

}  // namespace
}  // namespace hybrid_slam
