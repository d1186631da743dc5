// Where SIFT finds what is known to be there, and that it finds the same in a turned or scaled
// image.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include <catch2/catch.hpp>
#include "frontend/features/sift.h"
#include "test/frontend/features/on_every_target.h"
#include "test/frontend/features/test_images.h"

namespace hybrid_slam {
namespace {

// The strongest feature within a pixel.
const Keypoint* strongest_at(const FeatureSet& features, const Blob& blob) {
  const Keypoint* best = nullptr;
  for (const Keypoint& k : features.keypoints) {
    if (std::hypot(k.x - blob.x, k.y - blob.y) > 1) continue;
    if (!best || k.response > best->response) best = &k;
  }
  return best;
}

TEST_CASE("SIFT finds blobs of every size where they are") {
  std::mt19937 random(7);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  SiftOptions options;
  options.upsample = GENERATE(true, false);
  const auto sift = make_sift(options);
  // Without upsampling there is no scale for the smallest.
  const double smallest = options.upsample ? 1.2 : 2.2;
  for (const double sigma : {1.2, 1.5, 2.0, 2.2, 2.5, 3.0, 3.6, 5.0, 8.0, 12.0}) {
    if (sigma < smallest) continue;
    std::vector<Blob> blobs;
    const double spacing = std::max(30.0, 12 * sigma);
    for (int row = 0; row < 6; ++row) {
      for (int column = 0; column < 8; ++column) {
        blobs.push_back(
            {(column + 1) * spacing + 8 * unit(), (row + 1) * spacing + 8 * unit(), sigma});
      }
    }
    const GrayImage image =
        blob_image(static_cast<int>(9 * spacing), static_cast<int>(7 * spacing), blobs, 150);
    const FeatureSet features = sift->extract(image, nullptr);
    double x = 0, y = 0, distance = 0, scale = 0;
    for (const Blob& blob : blobs) {
      const Keypoint* k = strongest_at(features, blob);
      REQUIRE(k);
      const double share = 1.0 / static_cast<double>(blobs.size());
      x += share * (k->x - blob.x);
      y += share * (k->y - blob.y);
      distance += share * std::hypot(k->x - blob.x, k->y - blob.y);
      scale += share * k->scale;
    }
    INFO("sigma " << sigma << ": bias " << x << ", " << y << ", mean distance " << distance
                  << ", scale " << scale);
    CHECK(std::abs(x) < 0.005);
    CHECK(std::abs(y) < 0.005);
    CHECK(distance < 0.02);
  }
}

// Shares of features of `first` that have one of `second` at the place, scale and angle that
// `expected` says.
template <typename Expected>
double agreement(const FeatureSet& first, const FeatureSet& second, double tolerance,
                 const Expected& expected) {
  int found = 0;
  for (const Keypoint& k : first.keypoints) {
    const Keypoint e = expected(k);
    found += std::any_of(second.keypoints.begin(), second.keypoints.end(), [&](const Keypoint& o) {
      return std::hypot(o.x - e.x, o.y - e.y) < tolerance &&
             std::abs(std::log(o.scale / e.scale)) < tolerance &&
             std::abs(std::remainder(o.angle - e.angle, 2 * std::numbers::pi)) < tolerance;
    });
  }
  return static_cast<double>(found) / static_cast<double>(first.size());
}

TEST_CASE("SIFT finds the same in an image that is turned by a quarter or mirrored") {
  SiftOptions options;
  options.upsample = GENERATE(true, false);
  options.max_features = 100000;
  const auto sift = make_sift(options);
  // Odd sides: every octave's samples lie where they lay.
  const GrayImage image = texture(257, 193, 31);
  GrayImage turned{193, 257, std::vector<std::uint8_t>(193 * 257)};
  GrayImage mirrored{257, 193, std::vector<std::uint8_t>(193 * 257)};
  for (int y = 0; y < 193; ++y) {
    for (int x = 0; x < 257; ++x) {
      turned.row(x)[192 - y] = image.row(y)[x];
      mirrored.row(y)[256 - x] = image.row(y)[x];
    }
  }
  const FeatureSet features = sift->extract(image, nullptr);
  REQUIRE(features.size() > 300);
  const double right = agreement(features, sift->extract(turned, nullptr), 0.01, [](Keypoint k) {
    k = {192 - k.y, k.x, k.scale, k.angle + static_cast<float>(std::numbers::pi / 2), 0, 0};
    return k;
  });
  CHECK(right > 0.99);
  const double back = agreement(features, sift->extract(mirrored, nullptr), 0.01, [](Keypoint k) {
    k = {256 - k.x, k.y, k.scale, static_cast<float>(std::numbers::pi) - k.angle, 0, 0};
    return k;
  });
  CHECK(back > 0.99);
}

TEST_CASE("SIFT finds the same in an image twice as large, with scales twice as large") {
  std::mt19937 random(3);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  std::vector<Blob> small, large;
  for (int i = 0; i < 60; ++i) {
    small.push_back({20 + 28.0 * (i % 10), 20 + 28.0 * (i / 10), 1.5 + 2.5 * unit()});
    small.back().x += 6 * unit();
    small.back().y += 6 * unit();
    large.push_back({2 * small.back().x, 2 * small.back().y, 2 * small.back().sigma});
  }
  const auto sift = make_sift({});
  const FeatureSet of_small = sift->extract(blob_image(300, 190, small, 130), nullptr);
  const FeatureSet of_large = sift->extract(blob_image(599, 379, large, 130), nullptr);
  for (std::size_t i = 0; i < small.size(); ++i) {
    const Keypoint* a = strongest_at(of_small, small[i]);
    const Keypoint* b = strongest_at(of_large, large[i]);
    REQUIRE(a);
    REQUIRE(b);
    CHECK(b->scale / a->scale == Approx(2).epsilon(0.06));
    CHECK(std::hypot(b->x - 2 * a->x, b->y - 2 * a->y) < 0.15);
  }
}

TEST_CASE("SIFT finds nearly the same with every instruction set") {
  const GrayImage image = texture(320, 240, 5);
  const FeatureSet reference = make_sift({})->extract(image, nullptr);
  on_every_target([&] {
    const FeatureSet features = make_sift({})->extract(image, nullptr);
    CHECK(agreement(reference, features, 0.01, [](const Keypoint& k) { return k; }) > 0.99);
    CHECK(agreement(features, reference, 0.01, [](const Keypoint& k) { return k; }) > 0.99);
  });
}

}  // namespace
}  // namespace hybrid_slam
