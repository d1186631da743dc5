#include "frontend/tracking/moving_regions.h"

#include <random>
#include <vector>

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

Calibrated<RectifiedStereo> camera() { return {{400, 400, 319.5, 239.5, 0.1}, 640, 480}; }

// Features all over the image; those in the box [400, 600] x [100, 300] move. So do a few others,
// as wrong matches seem to.
std::vector<FollowedFeature> scene(std::mt19937& random, double wrong, bool box_moves) {
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<FollowedFeature> features;
  for (int i = 0; i < 400; ++i) {
    const double x = 640 * unit(random);
    const double y = 480 * unit(random);
    const bool in_box = x >= 400 && x <= 600 && y >= 100 && y <= 300;
    features.push_back({x, y, (box_moves && in_box) || unit(random) < wrong});
  }
  return features;
}

void add_keypoint(StereoFeatures& features, const Eigen::Vector3d& point) {
  Keypoint keypoint;
  keypoint.x = static_cast<float>(400 * point.x() / point.z() + 319.5);
  keypoint.y = static_cast<float>(400 * point.y() / point.z() + 239.5);
  features.left.keypoints.push_back(keypoint);
  features.left.descriptors.emplace_back();
  features.u_right.push_back(keypoint.x - static_cast<float>(400 * 0.1 / point.z()));
}

}  // namespace

TEST_CASE("What moves in one place is a region there, and nowhere else") {
  std::mt19937 random(1);
  MovingRegions regions(640, 480);
  for (int frame = 0; frame < 5; ++frame) regions.add(0.2, scene(random, 0.05, true));
  CHECK(regions.contains(500, 200));
  CHECK(regions.contains(440, 140));
  CHECK_FALSE(regions.contains(100, 100));
  CHECK_FALSE(regions.contains(500, 400));
  // The box is 13 % of the image; its border may be missed or added.
  CHECK(regions.share() == Approx(0.13).margin(0.05));
}

TEST_CASE("Wrong matches all over the image are no region") {
  for (const double wrong : {0.05, 0.2, 0.5}) {
    std::mt19937 random(2);
    MovingRegions regions(640, 480);
    for (int frame = 0; frame < 200; ++frame) {
      regions.add(0.2, scene(random, wrong, false));
      REQUIRE(regions.share() == 0);
    }
  }
}

TEST_CASE("What has gone is forgotten within seconds") {
  std::mt19937 random(3);
  MovingRegions regions(640, 480);
  for (int frame = 0; frame < 10; ++frame) regions.add(0.2, scene(random, 0.02, true));
  REQUIRE(regions.contains(500, 200));
  double seconds = 0;
  for (; regions.share() > 0 && seconds < 10; seconds += 0.2) {
    regions.add(0.2, scene(random, 0.02, false));
  }
  CHECK(seconds > 0.5);
  CHECK(seconds < 4);
}

TEST_CASE("Matches speak against the camera's motion, for it, or not at all") {
  // The camera moves to the right by 5 cm: a point 1 m away moves to the left by 20 px.
  const Rigid3d motion(Eigen::Quaterniond::Identity(), {-0.05, 0, 0});
  const std::vector<Eigen::Vector3d> before{{0, 0, 1}, {0.1, 0.1, 1}, {0, 0.1, 20}, {-0.1, 0, 1}};
  std::vector<Eigen::Vector3d> now;
  for (const Eigen::Vector3d& point : before) now.push_back(motion * point);
  now[1] = before[1];                     // moves along with the camera
  now[3] += Eigen::Vector3d(0.01, 0, 0);  // 4 px off
  StereoFeatures previous;
  StereoFeatures current;
  std::vector<CircularMatch> matches;
  for (int i = 0; i < 4; ++i) {
    add_keypoint(previous, before[static_cast<std::size_t>(i)]);
    add_keypoint(current, now[static_cast<std::size_t>(i)]);
    matches.push_back({i, i});
  }
  const auto features = followed_features(camera(), previous, current, matches, motion);
  // The third is so far away that the motion of the camera is not seen in it.
  REQUIRE(features.size() == 2);
  CHECK_FALSE(features[0].moves);
  CHECK(features[0].x == Approx(299.5));
  CHECK(features[1].moves);
  CHECK(features[1].x == Approx(359.5));
}

}  // namespace hybrid_slam
