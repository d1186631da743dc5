#include "frontend/matching/pair_check.h"

#include <catch2/catch.hpp>
#include <random>
#include <stdexcept>

namespace hybrid_slam {
namespace {

// 200 features, and the same 10 px to the left and `rows` px lower.
std::pair<FeatureSet, FeatureSet> make_pair_of(double rows) {
  std::mt19937 random(1);
  FeatureSet left;
  left.kind = DescriptorKind::kSynthetic;
  for (int i = 0; i < 200; ++i) {
    Keypoint keypoint;
    keypoint.x = static_cast<float>(50 + random() % 500);
    keypoint.y = static_cast<float>(50 + random() % 300);
    keypoint.scale = 2;
    left.keypoints.push_back(keypoint);
    Descriptor descriptor;
    for (std::uint8_t& byte : descriptor) byte = static_cast<std::uint8_t>(random() % 90);
    left.descriptors.push_back(descriptor);
  }
  FeatureSet right = left;
  for (Keypoint& keypoint : right.keypoints) {
    keypoint.x -= 10;
    keypoint.y += static_cast<float>(rows);
  }
  return {left, right};
}

TEST_CASE("A pair, a pair of which the rows disagree, and one that is swapped") {
  const auto [left, right] = make_pair_of(0.25);
  const PairCheck good = check_pair(left, right);
  CHECK(good.matches == 200);
  CHECK(good.row_error == Approx(0.25).margin(1e-3));
  CHECK(good.reversed == 0);
  CHECK(check_pair(right, left).reversed == 1);
  const auto [one, other] = make_pair_of(3);
  CHECK(check_pair(one, other).row_error == Approx(3).margin(1e-3));
  CHECK(check_pair(one, FeatureSet{DescriptorKind::kSynthetic, {}, {}}).matches == 0);
  FeatureSet of_another_kind = other;
  of_another_kind.kind = DescriptorKind::kRootSift;
  CHECK_THROWS_AS(check_pair(one, of_another_kind), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
