#include "frontend/matching/stereo_matcher.h"

#include <cmath>
#include <stdexcept>

#include <catch2/catch.hpp>

#include "test/frontend/matching/random_descriptors.h"

namespace hybrid_slam {
namespace {

Calibrated<RectifiedStereo> stereo_camera() {
  return {{500, 500, 320, 240, 0.1}, 640, 480};  // fx, fy, cx, cy [px], baseline [m]
}

void add(FeatureSet* set, double x, double y, const Descriptor& descriptor, double scale = 2) {
  Keypoint k;
  k.x = static_cast<float>(x);
  k.y = static_cast<float>(y);
  k.scale = static_cast<float>(scale);
  k.sigma = 0.1F;
  set->kind = DescriptorKind::kSynthetic;
  set->keypoints.push_back(k);
  set->descriptors.push_back(descriptor);
}

StereoFeatures match(const FeatureSet& left, const FeatureSet& right) {
  return match_stereo(left, right, nullptr, nullptr, stereo_camera(), {});
}

// A descriptor of length 512 with all its weight in four of its bytes.
Descriptor unit_descriptor(std::size_t place) {
  Descriptor descriptor{};
  for (std::size_t i = 0; i < 4; ++i) descriptor[4 * place + i] = 255;
  return descriptor;
}

TEST_CASE("The stereo matcher finds every known disparity") {
  std::mt19937_64 random(4);
  FeatureSet left, right;
  constexpr int kCount = 400;
  std::vector<double> disparity;
  for (int i = 0; i < kCount; ++i) {
    const Descriptor descriptor = random_descriptor(random, 100);
    const double x = 340 + 290 * random_unit(random);
    const double y = 479 * random_unit(random);
    disparity.push_back(0.2 + 300 * random_unit(random));
    add(&left, x, y, descriptor);
    Descriptor noisy = descriptor;
    for (std::uint8_t& byte : noisy) byte = static_cast<std::uint8_t>(byte + random() % 8);
    add(&right, x - disparity.back(), y + 1.6 * random_unit(random) - 0.8, noisy);
  }
  // In another order than the left ones.
  std::swap(right.keypoints[3], right.keypoints[77]);
  std::swap(right.descriptors[3], right.descriptors[77]);
  StereoMatcherOptions options;
  options.max_descriptor_distance = 2;
  const StereoFeatures found =
      match_stereo(left, right, nullptr, nullptr, stereo_camera(), options);
  REQUIRE(found.right_of_left.size() == kCount);
  REQUIRE(found.u_right.size() == kCount);
  for (int i = 0; i < kCount; ++i) {
    const auto k = static_cast<std::size_t>(i);
    CHECK(found.right_of_left[k] == (i == 3 ? 77 : i == 77 ? 3 : i));
    CHECK(left.keypoints[k].x - found.u_right[k] == Approx(disparity[k]).margin(1e-4));
  }
}

TEST_CASE("The stereo matcher keeps to rows, disparities and scales that can be") {
  const Descriptor d = unit_descriptor(0);
  const auto found = [&](double x, double y, double scale) {
    FeatureSet left, right;
    add(&left, 400, 100, d);
    add(&right, x, y, d, scale);
    const StereoFeatures stereo = match(left, right);
    CHECK(std::isnan(stereo.u_right[0]) == (stereo.right_of_left[0] < 0));
    return stereo.right_of_left[0] == 0;
  };
  CHECK(found(390, 100, 2));
  CHECK(found(390, 101.12, 2));  // 1 + hypot(0.1, 0.1) = 1.141
  CHECK_FALSE(found(390, 101.16, 2));
  CHECK_FALSE(found(390, 98.84, 2));
  CHECK_FALSE(found(400, 100, 2));  // infinite depth
  CHECK_FALSE(found(401, 100, 2));
  CHECK(found(67, 100, 2));  // 500 / 1.5 = 333.3
  CHECK_FALSE(found(66, 100, 2));
  CHECK(found(390, 100, 2.9));
  CHECK_FALSE(found(390, 100, 3.1));
  CHECK_FALSE(found(390, 100, 1.3));
}

TEST_CASE("The stereo matcher refuses the doubtful and the taken") {
  const Descriptor d = unit_descriptor(0);
  Descriptor near = d;
  near[100] = 60;
  Descriptor nearer = d;
  nearer[100] = 57;
  FeatureSet left, right;
  add(&left, 400, 100, d);
  add(&right, 380, 100, near);
  CHECK(match(left, right).right_of_left[0] == 0);
  add(&right, 350, 100, nearer);  // 57 / 60: too alike
  CHECK(match(left, right).right_of_left[0] == -1);
  right.keypoints[1].x = 380.5F;  // the same place, another orientation
  CHECK(match(left, right).right_of_left[0] == 1);
  right.descriptors[1] = d;
  right.keypoints[1].x = 350;
  CHECK(match(left, right).right_of_left[0] == 1);

  add(&left, 420, 100, near);  // right 0 is better for left 1, and has no other suitor
  CHECK(match(left, right).right_of_left == std::vector<int>{1, 0});
  right.keypoints.resize(1);
  right.descriptors.resize(1);
  CHECK(match(left, right).right_of_left == std::vector<int>{-1, 0});
}

TEST_CASE("The stereo matcher of few or none, and of different kinds") {
  FeatureSet left, right;
  CHECK(match(left, right).right_of_left.empty());
  add(&left, 400, 100, unit_descriptor(0));
  CHECK(match(left, right).right_of_left == std::vector<int>{-1});
  CHECK(match(right, left).right_of_left.empty());
  add(&right, 300, 100, unit_descriptor(1));  // orthogonal: distance sqrt(2)
  CHECK(match(left, right).right_of_left == std::vector<int>{-1});
  right.kind = DescriptorKind::kRootSiftOpenCv;
  CHECK_THROWS_AS(match(left, right), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
