#include "frontend/features/feature_selection.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <set>
#include <utility>

#include <catch2/catch.hpp>

#include "frontend/features/key_sort.h"

namespace hybrid_slam {
namespace {

Keypoint keypoint(double x, double y, double response) {
  Keypoint k;
  k.x = static_cast<float>(x);
  k.y = static_cast<float>(y);
  k.response = static_cast<float>(response);
  k.scale = 1;
  return k;
}

// Strong keypoints crowded into the left eighth of a 640x480 image, weak ones everywhere.
std::vector<Keypoint> crowd() {
  std::mt19937 random(1);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<Keypoint> keypoints;
  for (int i = 0; i < 2000; ++i)
    keypoints.push_back(keypoint(80 * unit(), 479 * unit(), 50 + unit()));
  for (int i = 0; i < 2000; ++i)
    keypoints.push_back(keypoint(639 * unit(), 479 * unit(), 2 + unit()));
  return keypoints;
}

TEST_CASE("Keys are sorted in all their bits, and equal ones keep their order") {
  std::mt19937_64 random(2);
  for (const std::uint64_t bits :
       {~std::uint64_t{0}, std::uint64_t{0xFF00FF}, std::uint64_t{7} << 60}) {
    std::vector<Keyed> items;
    for (std::uint32_t i = 0; i < 3000; ++i) items.push_back({random() & bits, i});
    std::vector<Keyed> expected = items;
    std::stable_sort(expected.begin(), expected.end(),
                     [](const Keyed& a, const Keyed& b) { return a.key < b.key; });
    sort_by_key(items);
    const auto same = [](const Keyed& a, const Keyed& b) {
      return a.key == b.key && a.index == b.index;
    };
    CHECK(std::equal(items.begin(), items.end(), expected.begin(), expected.end(), same));
  }
  std::vector<Keyed> none;
  sort_by_key(none);
  CHECK(none.empty());
}

TEST_CASE("select_spread orders by response, of whatever sign, then by place") {
  const std::vector<Keypoint> keypoints = {keypoint(3, 3, -1),   keypoint(9, 9, 0),
                                           keypoint(5, 5, -0.0), keypoint(7, 7, 2),
                                           keypoint(6, 6, 2),    keypoint(8, 8, -3)};
  CHECK(select_spread(keypoints, 20, 20, 6) == std::vector<int>{4, 3, 2, 1, 0, 5});
}

TEST_CASE("select_spread keeps all while there are no more than asked for") {
  const std::vector<Keypoint> keypoints = {keypoint(3, 3, 1), keypoint(9, 9, 3), keypoint(5, 5, 2)};
  CHECK(select_spread(keypoints, 20, 20, 3) == std::vector<int>{1, 2, 0});
  CHECK(select_spread(keypoints, 20, 20, 1) == std::vector<int>{1});
  CHECK(select_spread({}, 20, 20, 5).empty());
}

TEST_CASE("select_spread leaves out what lies outside the image") {
  const std::vector<Keypoint> keypoints = {keypoint(-0.6, 3, 9), keypoint(19.6, 3, 9),
                                           keypoint(3, 19.6, 9), keypoint(19.4, 19.4, 1)};
  CHECK(select_spread(keypoints, 20, 20, 4) == std::vector<int>{3});
}

TEST_CASE("select_spread takes the strongest and leaves no part of the image empty") {
  const std::vector<Keypoint> keypoints = crowd();
  const std::vector<int> selected = select_spread(keypoints, 640, 480, 500);
  REQUIRE(selected.size() == 500);
  CHECK(std::set<int>(selected.begin(), selected.end()).size() == 500);
  std::vector<int> order(4000);
  std::iota(order.begin(), order.end(), 0);
  const auto response = [&](int i) { return keypoints[static_cast<std::size_t>(i)].response; };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return response(a) > response(b); });
  // The 375 strongest, all in the crowd, then about 14 for each of nine blocks beside it.
  CHECK(std::equal(selected.begin(), selected.begin() + 375, order.begin(),
                   [&](int a, int b) { return response(a) == response(b); }));
  std::map<std::pair<int, int>, int> blocks;
  for (const int i : selected) {
    const Keypoint& k = keypoints[static_cast<std::size_t>(i)];
    if (k.x >= 80) ++blocks[{static_cast<int>((k.x - 80) / 187), static_cast<int>(k.y / 160)}];
  }
  for (int column = 0; column < 3; ++column) {
    for (int row = 0; row < 3; ++row) CHECK(blocks[std::pair(column, row)] >= 8);
  }
}

TEST_CASE("select_spread takes the strongest of one place") {
  // One cell: the order of strength alone.
  std::vector<Keypoint> keypoints;
  for (int i = 0; i < 100; ++i) keypoints.push_back(keypoint(i % 10, i / 10, (i * 37) % 100));
  const std::vector<int> selected = select_spread(keypoints, 10, 10, 5);
  std::vector<float> responses;
  for (const int i : selected) responses.push_back(keypoints[static_cast<std::size_t>(i)].response);
  CHECK(responses == std::vector<float>{99, 98, 97, 96, 95});
}

TEST_CASE("select_spread does not depend on the order of its input") {
  std::vector<Keypoint> keypoints = crowd();
  for (Keypoint& k : keypoints) k.response = std::floor(k.response);  // many ties
  std::vector<Keypoint> reversed(keypoints.rbegin(), keypoints.rend());
  const std::vector<int> a = select_spread(keypoints, 640, 480, 700);
  const std::vector<int> b = select_spread(reversed, 640, 480, 700);
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    CHECK(keypoints[static_cast<std::size_t>(a[i])].x ==
          reversed[static_cast<std::size_t>(b[i])].x);
  }
}

}  // namespace
}  // namespace hybrid_slam
