#include "frontend/calibration/pair_alignment.h"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

namespace hybrid_slam {
namespace {

const Calibrated<RectifiedStereo> kCamera{{430, 430, 255.5, 191.5, 0.15}, 512, 384};
constexpr double kDegree = 0.017453292519943295;

// What a right camera sees that is turned by these angles about its axes, and of this focal length.
struct WrongCamera {
  double pitch = 0, yaw = 0, roll = 0;  // [rad]
  double focal_ratio = 0;

  Eigen::Vector2d pixel_of(const Eigen::Vector2d& aligned) const {
    const auto& [fx, fy, cx, cy, baseline] = kCamera.params;
    const Eigen::Matrix3d turn = (Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) *
                                  Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitZ()))
                                     .toRotationMatrix();
    const Eigen::Vector3d ray =
        turn * Eigen::Vector3d((aligned.x() - cx) / fx, (aligned.y() - cy) / fy, 1);
    return {(1 + focal_ratio) * fx * ray.x() / ray.z() + cx,
            (1 + focal_ratio) * fy * ray.y() / ray.z() + cy};
  }
};

// Every tenth is wrong.
std::vector<PairMatch> matches_of(const WrongCamera& wrong, int count, double noise, int seed) {
  std::mt19937 random(static_cast<unsigned>(seed));
  std::uniform_real_distribution<double> column(60, 511), row(0, 383), disparity(5, 60);
  std::normal_distribution<double> error(0, noise);
  std::vector<PairMatch> matches;
  for (int i = 0; i < count; ++i) {
    const Eigen::Vector2d left(column(random), row(random));
    Eigen::Vector2d right = wrong.pixel_of({left.x() - disparity(random), left.y()});
    if (i % 10 == 0) right.y() = row(random);
    matches.push_back({static_cast<float>(left.x()), static_cast<float>(left.y()),
                       static_cast<float>(left.y() - right.y() + error(random)),
                       static_cast<float>(left.x() - right.x()), 2});
  }
  return matches;
}

TEST_CASE("a right camera that is turned shows in the rows", "[pair_alignment]") {
  const WrongCamera wrong{0.2 * kDegree, 0, -0.15 * kDegree, 0.004};
  const auto found = find_pair_alignment(kCamera, matches_of(wrong, 1000, 0.3, 1));
  REQUIRE(found);
  CHECK(is_shown(*found));
  // Four standard deviations: 0.3 px of 900 matches over 430 px, by what the parameters move.
  CHECK(found->pitch == Approx(wrong.pitch).margin(4 * 0.3 / 430 / 30 * 1.5));
  CHECK(found->roll == Approx(wrong.roll).margin(4 * 0.3 / 430 / 30 / 0.3));
  CHECK(found->focal_ratio == Approx(wrong.focal_ratio).margin(4 * 0.3 / 430 / 30 / 0.25));
  CHECK(found->row_sigma == Approx(0.3).margin(0.03));
  CHECK(found->row_rms == Approx(1.6).margin(0.2));
  CHECK(found->matches >= 850);
}

TEST_CASE("a pair that is aligned is left alone", "[pair_alignment]") {
  for (int seed = 0; seed < 20; ++seed) {
    const auto found = find_pair_alignment(kCamera, matches_of({}, 400, 0.3, seed));
    REQUIRE(found);
    CHECK_FALSE(is_shown(*found));
  }
  // Certain, but less than the noise of one match: 0.02 deg are 0.15 px.
  const auto small = find_pair_alignment(kCamera, matches_of({0.02 * kDegree}, 4000, 0.3, 1));
  REQUIRE(small);
  CHECK(small->pitch == Approx(0.02 * kDegree).epsilon(0.2));
  CHECK_FALSE(is_shown(*small));
}

TEST_CASE("few matches tell nothing of the rows", "[pair_alignment]") {
  CHECK_FALSE(find_pair_alignment(kCamera, matches_of({0.2 * kDegree}, 40, 0.3, 1)));
  CHECK_FALSE(find_pair_alignment(kCamera, {}));
  auto large = matches_of({0.2 * kDegree}, 1000, 0.3, 1);
  for (PairMatch& match : large) match.scale = 5;
  CHECK_FALSE(find_pair_alignment(kCamera, large));
}

TEST_CASE("an aligned image is what the right camera should have seen", "[pair_alignment]") {
  const WrongCamera wrong{0.2 * kDegree, 0, 0.2 * kDegree, 0.005};
  const auto scene = [](const Eigen::Vector2d& pixel) {
    return 128 + 60 * std::sin(pixel.x() / 9) * std::cos(pixel.y() / 7);
  };
  // The scene as it should be seen, at the place that the wrong camera shows there.
  PairAlignment alignment;
  alignment.pitch = wrong.pitch;
  alignment.roll = wrong.roll;
  alignment.focal_ratio = wrong.focal_ratio;
  GrayImage raw{512, 384, std::vector<std::uint8_t>(512 * 384)};
  for (int y = 0; y < raw.height; ++y) {
    for (int x = 0; x < raw.width; ++x) {
      Eigen::Vector2d aligned(x, y);  // by fixed point: the wrong camera's map is nearly a shift
      for (int i = 0; i < 20; ++i) aligned += Eigen::Vector2d(x, y) - wrong.pixel_of(aligned);
      raw.row(y)[x] = static_cast<std::uint8_t>(std::lround(scene(aligned)));
    }
  }
  RightAligner(kCamera, alignment).align(raw);
  double worst = 0;
  for (int y = 8; y < raw.height - 8; ++y) {
    for (int x = 8; x < raw.width - 8; ++x) {
      worst = std::max(worst, std::abs(raw.row(y)[x] - scene({x, y})));
    }
  }
  // Rounding, twice, and the interpolation's 1/32 px at 60 / 7 grey levels per pixel.
  CHECK(worst < 2.5);
}

}  // namespace
}  // namespace hybrid_slam
