#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include <catch2/catch.hpp>

#include "apps/feature_eval/methods/method_choice.h"
#include "apps/feature_eval/methods/opencv_features.h"
#include "test/frontend/features/test_images.h"

namespace hybrid_slam {
namespace {

const std::vector<std::string> kNames{"sift", "rootsift", "cv_sift", "cv_rootsift",
                                      "orb",  "akaze",    "kaze",    "brisk"};

std::unique_ptr<FeatureMethod> make(const std::string& name, int features = 2000) {
  SiftOptions sift;
  sift.max_features = features;
  std::vector<std::string> missing;
  auto methods = make_methods({name}, sift, missing);
  REQUIRE(methods.size() == 1);
  CHECK(methods.front().name == name);
  return std::move(methods.front().method);
}

GrayImage cut(const GrayImage& image, int left, int top, int width, int height) {
  return to_image(width, height, [&](double x, double y) {
    return image.row(static_cast<int>(y) + top)[static_cast<int>(x) + left];
  });
}

DescribedFeatures floats(const std::vector<std::array<float, 2>>& rows) {
  DescribedFeatures features;
  features.keypoints.resize(rows.size());
  FloatDescriptors descriptors{2, {}};
  for (const auto& row : rows) {
    descriptors.values.insert(descriptors.values.end(), row.begin(), row.end());
  }
  features.descriptors = descriptors;
  return features;
}

DescribedFeatures bits(const std::vector<std::uint8_t>& rows) {
  DescribedFeatures features;
  features.keypoints.resize(rows.size());
  features.descriptors = BitDescriptors{1, rows};
  return features;
}

TEST_CASE("descriptors of numbers match if they are nearest both ways and clearly so") {
  const DescribedFeatures train = floats({{0, 0}, {10, 0}, {10, 10}});
  // The first: 1 from (0, 0), 9.06 from the next. The second: 4.9 and 5.1, no clear one. The third
  // and the fourth have one nearest, which prefers the fourth.
  const auto matches = match_described(floats({{0, 1}, {4.9F, 0}, {10, 8}, {10, 9}}), train, 0.8);
  REQUIRE(matches.size() == 2);
  CHECK((matches[0].query == 0 && matches[0].train == 0));
  CHECK(matches[0].distance == Approx(1));
  CHECK((matches[1].query == 3 && matches[1].train == 2));
  CHECK(match_described(floats({{0, 1}, {4.9F, 0}}), train, 1).size() == 1);  // (0, 0) has one only
  CHECK(match_described(floats({{4.9F, 0}}), train, 1).size() == 1);
  CHECK(match_described(floats({{5, 5}}), floats({{0, 0}}), 0.8).size() == 1);  // no second one
  CHECK(match_described(floats({}), train, 0.8).empty());
  CHECK(match_described(train, floats({}), 0.8).empty());
}

TEST_CASE("descriptors of bits match by how many differ") {
  const auto matches =
      match_described(bits({0b00000001, 0b11110111}), bits({0b11111111, 0, 0b00001111}), 0.8);
  REQUIRE(matches.size() == 2);
  CHECK((matches[0].query == 0 && matches[0].train == 1 && matches[0].distance == 1));
  CHECK((matches[1].query == 1 && matches[1].train == 0 && matches[1].distance == 1));
  // 1 and 2 bits: one half is clear at 0.8 and not at 0.5.
  CHECK(match_described(bits({0b1}), bits({0, 0b111}), 0.8).size() == 1);
  CHECK(match_described(bits({0b1}), bits({0, 0b111}), 0.5).empty());
  CHECK_THROWS_AS(match_described(bits({1}), floats({{1, 2}}), 0.8), std::logic_error);
}

TEST_CASE("every method finds by how much an image is shifted") {
  const GrayImage image = texture(260, 220, 5);
  const GrayImage first = cut(image, 0, 0, 220, 190), second = cut(image, 7, 4, 220, 190);
  for (const std::string& name : kNames) {
    INFO(name);
    const auto method = make(name, 300);
    StageTimes times;
    const DescribedFeatures a = method->extract(first, nullptr, times);
    const DescribedFeatures b = method->extract(second, nullptr, times);
    CHECK(a.size() <= 300);
    CHECK(a.size() > 40);
    const auto matches = method->match(a, b, times);
    CHECK(matches.size() > a.size() / 5);
    const auto right = std::count_if(matches.begin(), matches.end(), [&](const FeatureMatch& m) {
      const Keypoint& from = a.keypoints[static_cast<std::size_t>(m.query)];
      const Keypoint& to = b.keypoints[static_cast<std::size_t>(m.train)];
      return std::hypot(from.x - to.x - 7, from.y - to.y - 4) < 1.5;
    });
    CHECK(static_cast<double>(right) > 0.9 * static_cast<double>(matches.size()));
    CHECK(times.stages().front().second.count() == 3);  // "total": two images, one match
    const DescribedFeatures again = make(name, 300)->extract(first, nullptr, times);
    REQUIRE(again.size() == a.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      CHECK(again.keypoints[i].x == a.keypoints[i].x);
      CHECK(again.keypoints[i].y == a.keypoints[i].y);
    }
  }
}

TEST_CASE("no method has keypoints where the mask is black") {
  const GrayImage image = texture(200, 160, 8);
  const GrayImage mask = to_image(200, 160, [](double x, double) { return x < 100 ? 255 : 0; });
  for (const std::string& name : kNames) {
    INFO(name);
    StageTimes times;
    const auto method = make(name);
    const auto beyond = [&](const GrayImage* used) {
      const DescribedFeatures features = method->extract(image, used, times);
      CHECK(features.size() > 20);
      return std::count_if(features.keypoints.begin(), features.keypoints.end(),
                           [](const Keypoint& k) { return k.x > 100; });
    };
    CHECK(beyond(nullptr) > 10);
    CHECK(beyond(&mask) == 0);
  }
}

TEST_CASE("OpenCV's SIFT lies where blobs are, and RootSIFT is the root of its share") {
  const std::vector<Blob> blobs = {{30.3, 40.6, 2.0}, {80.75, 35.2, 3.0}, {60.5, 90.1, 4.5}};
  const GrayImage image = blob_image(120, 120, blobs, 100);
  StageTimes times;
  const DescribedFeatures plain = make("cv_sift")->extract(image, nullptr, times);
  const DescribedFeatures root = make("cv_rootsift")->extract(image, nullptr, times);
  for (const Blob& blob : blobs) {
    CHECK(std::any_of(plain.keypoints.begin(), plain.keypoints.end(), [&](const Keypoint& k) {
      return std::hypot(k.x - blob.x, k.y - blob.y) < 0.06 &&
             std::abs(k.scale / blob.sigma - 1) < 0.25;
    }));
  }
  const auto& numbers = std::get<FloatDescriptors>(plain.descriptors);
  const auto& roots = std::get<FloatDescriptors>(root.descriptors);
  REQUIRE(numbers.length == 128);
  REQUIRE(numbers.values.size() == roots.values.size());
  const float sum = std::accumulate(numbers.values.begin(), numbers.values.begin() + 128, 0.0F);
  for (std::size_t i = 0; i < 128; ++i) {
    CHECK(roots.values[i] == Approx(std::sqrt(numbers.values[i] / sum)).margin(1e-6));
  }
}

TEST_CASE("our plain SIFT is the square of our RootSIFT, as long") {
  const GrayImage image = texture(200, 160, 8);
  StageTimes times;
  const auto bytes_of = [&](const std::string& name) {
    return std::get<std::vector<Descriptor>>(
        make(name)->extract(image, nullptr, times).descriptors);
  };
  const auto plain = bytes_of("sift"), root = bytes_of("rootsift");
  REQUIRE(plain.size() == root.size());
  REQUIRE(plain.size() > 50);
  for (std::size_t i = 0; i < plain.size(); ++i) {
    double length = 0, squares = 0;
    for (std::size_t k = 0; k < 128; ++k) {
      length += std::pow(plain[i][k], 2);
      squares += std::pow(root[i][k], 4);
    }
    CHECK(std::sqrt(length) == Approx(512).epsilon(0.02));  // rounding of 128 bytes
    for (std::size_t k = 0; k < 128; ++k) {
      const double share = std::pow(root[i][k], 2) / std::sqrt(squares);
      CHECK(plain[i][k] == Approx(std::min(512 * share, 255.0)).margin(0.5001));
    }
  }
}

TEST_CASE("methods are known by their names") {
  CHECK(split_method_names("sift,onnx:a b.yaml") ==
        std::vector<std::string>{"sift", "onnx:a b.yaml"});
  for (const std::string& name : kNames) CHECK(why_no_method_name(name).empty());
  CHECK(why_no_method_name("surf").empty());
  CHECK(why_no_method_name("onnx:x.yaml").empty());
  for (const char* const name : {"", "SIFT", "surf2", "onnx:", "onnx"}) {
    CHECK_FALSE(why_no_method_name(name).empty());
  }
  std::vector<std::string> missing;
  const auto methods = make_methods({"orb", "surf"}, {}, missing);
  const bool has_surf = why_no_opencv_features("surf").empty();
  CHECK(methods.size() == (has_surf ? 2 : 1));
  CHECK(missing.size() == (has_surf ? 0 : 1));
}

}  // namespace
}  // namespace hybrid_slam
