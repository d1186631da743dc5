#include "frontend/matching/circular_matcher.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "backend/map/frame_observations.h"
#include "test/frontend/matching/random_descriptors.h"

namespace hybrid_slam {
namespace {

// Points whose descriptors differ a little between all images; -1 in `right_of_left` for
// every `lost`-th.
StereoFeatures stereo_frame(const std::vector<Descriptor>& points, std::mt19937_64& random,
                            std::size_t lost) {
  const auto noisy = [&](Descriptor descriptor) {
    for (std::uint8_t& byte : descriptor) byte = static_cast<std::uint8_t>(byte + random() % 6);
    return descriptor;
  };
  StereoFeatures frame;
  frame.left.kind = frame.right.kind = DescriptorKind::kSynthetic;
  const std::size_t count = points.size();
  frame.left.keypoints.resize(count);
  frame.right.keypoints.resize(count);
  frame.right.descriptors.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    // The right features in the opposite order.
    const std::size_t r = count - 1 - i;
    frame.left.descriptors.push_back(noisy(points[i]));
    frame.right.descriptors[r] = noisy(points[i]);
    const bool matched = i % lost != 0;
    frame.right_of_left.push_back(matched ? static_cast<int>(r) : -1);
    frame.u_right.push_back(matched ? 1.0F : kNoRightMatch);
  }
  return frame;
}

std::vector<Descriptor> random_points(std::mt19937_64& random, int count) {
  std::vector<Descriptor> points;
  for (int i = 0; i < count; ++i) points.push_back(random_descriptor(random, 60));
  return points;
}

TEST_CASE("Circles close on the points that all four images have matched") {
  std::mt19937_64 random(5);
  std::vector<Descriptor> points = random_points(random, 200);
  const StereoFeatures previous = stereo_frame(points, random, 7);
  std::rotate(points.begin(), points.begin() + 50, points.end());
  const StereoFeatures current = stereo_frame(points, random, 5);
  const std::vector<CircularMatch> circles = match_circular(previous, current, {});
  std::vector<CircularMatch> expected;
  for (int p = 0; p < 200; ++p) {
    const int c = (p + 150) % 200;
    if (p % 7 != 0 && c % 5 != 0) expected.push_back({p, c});
  }
  REQUIRE(circles.size() == expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    CHECK(circles[k].previous == expected[k].previous);
    CHECK(circles[k].current == expected[k].current);
  }
}

TEST_CASE("A circle with one wrong leg does not close") {
  std::mt19937_64 random(6);
  const std::vector<Descriptor> points = random_points(random, 20);
  const StereoFeatures previous = stereo_frame(points, random, 100);
  const std::size_t before = match_circular(previous, previous, {}).size();
  REQUIRE(before == 19);

  SECTION("in the current stereo pair") {
    StereoFeatures current = previous;
    std::swap(current.right_of_left[4], current.right_of_left[9]);
    const std::vector<CircularMatch> circles = match_circular(previous, current, {});
    CHECK(circles.size() == 17);
    for (const CircularMatch& circle : circles) CHECK((circle.current != 4 && circle.current != 9));
  }
  SECTION("in time") {
    StereoFeatures current = previous;
    std::swap(current.left.descriptors[4], current.left.descriptors[9]);
    CHECK(match_circular(previous, current, {}).size() == 17);
  }
  SECTION("with descriptors too far apart") {
    StereoFeatures current = previous;
    for (Descriptor* d : {&current.left.descriptors[4], &current.right.descriptors[15]}) {
      for (std::uint8_t& byte : *d) byte = static_cast<std::uint8_t>(byte + 100);
    }
    CHECK(match_circular(previous, current, {}).size() == 18);
  }
}

TEST_CASE("Circles of frames without features") {
  std::mt19937_64 random(7);
  const StereoFeatures frame = stereo_frame(random_points(random, 5), random, 100);
  CHECK(match_circular({}, frame, {}).empty());
  CHECK(match_circular(frame, {}, {}).empty());
  CHECK(match_circular({}, {}, {}).empty());
}

}  // namespace
}  // namespace hybrid_slam
