#include "frontend/matching/keypoint_grid.h"

#include <algorithm>
#include <cmath>

#include <catch2/catch.hpp>

#include "test/frontend/matching/random_descriptors.h"

namespace hybrid_slam {
namespace {

std::vector<int> naive_query(const std::vector<Keypoint>& keypoints, double x, double y, double r) {
  std::vector<int> found;
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    const double dx = keypoints[i].x - x;
    const double dy = keypoints[i].y - y;
    if (dx * dx + dy * dy <= r * r) found.push_back(static_cast<int>(i));
  }
  return found;
}

TEST_CASE("The grid finds what a naive search finds") {
  std::mt19937_64 random(3);
  for (const int count : {0, 1, 31, 500}) {
    std::vector<Keypoint> keypoints(static_cast<std::size_t>(count));
    for (Keypoint& k : keypoints) {
      // Some lie outside the image.
      k.x = static_cast<float>(340 * random_unit(random) - 10);
      k.y = static_cast<float>(260 * random_unit(random) - 10);
    }
    const KeypointGrid grid(keypoints, 320, 240, 16);
    for (int k = 0; k < 200; ++k) {
      const double x = 400 * random_unit(random) - 40;
      const double y = 320 * random_unit(random) - 40;
      const double radius = 60 * random_unit(random);
      std::vector<int> found;
      grid.query(x, y, radius, &found);
      std::sort(found.begin(), found.end());
      CHECK(found == naive_query(keypoints, x, y, radius));
    }
  }
}

TEST_CASE("The grid appends, includes the rim, and orders by cell and index") {
  std::vector<Keypoint> keypoints(4);
  keypoints[0].x = 20;  // the second cell of the first row
  keypoints[1].x = 5;
  keypoints[2].y = 20;  // the second row
  keypoints[3].x = 4;
  const KeypointGrid grid(keypoints, 32, 32, 16);
  std::vector<int> found = {7};
  grid.query(0, 0, 20, &found);
  CHECK(found == std::vector<int>{7, 1, 3, 0, 2});
  found.clear();
  grid.query(0, 0, 19.999, &found);
  CHECK(found == std::vector<int>{1, 3});
}

TEST_CASE("The grid answers senseless queries with nothing") {
  const std::vector<Keypoint> keypoints(3);
  const KeypointGrid grid(keypoints, 32, 32);
  std::vector<int> found;
  grid.query(std::nan(""), 0, 5, &found);
  grid.query(0, 0, -1, &found);
  grid.query(0, 0, std::nan(""), &found);
  grid.query(1e30, -1e30, 5, &found);
  CHECK(found.empty());
}

}  // namespace
}  // namespace hybrid_slam
