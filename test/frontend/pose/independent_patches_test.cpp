#include "frontend/pose/independent_patches.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

Keypoint at(float x, float y, float scale) { return {.x = x, .y = y, .scale = scale}; }

TEST_CASE("Descriptors of the same place count once, those beside one another each") {
  CHECK(count_independent({}) == 0);
  // Two orientations and three scales of one blob.
  CHECK(count_independent({at(50, 60, 2), at(50, 60, 2), at(51, 60, 2.5F), at(49, 61, 4)}) == 1);
  // A square of scale 2 is 24 px wide: half of it is 12.
  CHECK(count_independent({at(50, 60, 2), at(61.9F, 60, 2)}) == 1);
  CHECK(count_independent({at(50, 60, 2), at(62.1F, 60, 2)}) == 2);
  CHECK(count_independent({at(50, 60, 2), at(50, 72.1F, 2)}) == 2);
  // The larger of the two decides.
  CHECK(count_independent({at(50, 60, 2), at(62.1F, 60, 2.5F)}) == 1);
}

TEST_CASE("The finest descriptors are chosen, in whatever order they come") {
  // One coarse descriptor over nine fine ones that do not touch.
  std::vector<Keypoint> keypoints{at(100, 100, 30)};
  for (int i = 0; i < 9; ++i) {
    keypoints.push_back(
        at(70 + 30 * static_cast<float>(i % 3), 70 + 30 * static_cast<float>(i / 3), 1.6F));
  }
  CHECK(count_independent(keypoints) == 9);
  CHECK(count_independent({keypoints.rbegin(), keypoints.rend()}) == 9);
}

TEST_CASE("Keypoints of no extent, and those beyond the image's edge, are counted") {
  CHECK(count_independent({at(5, 5, 0), at(5, 5, 0), at(5.1F, 5, 0)}) == 3);
  CHECK(count_independent({at(-3, -20, 1), at(4, -20, 1), at(0, 900, 1)}) == 3);
}

}  // namespace
}  // namespace hybrid_slam
