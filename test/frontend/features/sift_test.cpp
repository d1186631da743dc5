#include "frontend/features/sift.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <numbers>
#include <random>
#include <set>

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

GrayImage to_image(int width, int height, const std::function<double(double, double)>& value) {
  GrayImage image{width, height, {}};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double v = std::clamp(std::round(value(x, y)), 0.0, 255.0);
      image.pixels.push_back(static_cast<std::uint8_t>(v));
    }
  }
  return image;
}

struct Blob {
  double x, y, sigma;
};

GrayImage blob_image(int width, int height, const std::vector<Blob>& blobs, double amplitude) {
  return to_image(width, height, [&](double x, double y) {
    double sum = 60;
    for (const Blob& b : blobs) {
      const double r2 = (x - b.x) * (x - b.x) + (y - b.y) * (y - b.y);
      sum += amplitude * std::exp(-r2 / (2 * b.sigma * b.sigma));
    }
    return sum;
  });
}

// Noise smoothed to random texture.
GrayImage texture(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<Blob> blobs;
  std::vector<double> signs;
  for (int i = 0; i < width * height / 60; ++i) {
    const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
    blobs.push_back({width * unit(), height * unit(), 1 + 3 * unit()});
    signs.push_back(unit() < 0.5 ? -40 : 40);
  }
  std::vector<double> sums(static_cast<std::size_t>(width * height), 128);
  for (std::size_t i = 0; i < blobs.size(); ++i) {
    const Blob& b = blobs[i];
    const int reach = static_cast<int>(4 * b.sigma);
    for (int y = std::max(0, static_cast<int>(b.y) - reach);
         y < std::min(height, static_cast<int>(b.y) + reach); ++y) {
      for (int x = std::max(0, static_cast<int>(b.x) - reach);
           x < std::min(width, static_cast<int>(b.x) + reach); ++x) {
        const double r2 = (x - b.x) * (x - b.x) + (y - b.y) * (y - b.y);
        sums[static_cast<std::size_t>(y * width + x)] +=
            signs[i] * std::exp(-r2 / (2 * b.sigma * b.sigma));
      }
    }
  }
  return to_image(width, height, [&](double x, double y) {
    return sums[static_cast<std::size_t>(static_cast<int>(y) * width + static_cast<int>(x))];
  });
}

bool same_bytes(const FeatureSet& a, const FeatureSet& b) {
  return a.size() == b.size() && a.descriptors == b.descriptors &&
         std::memcmp(a.keypoints.data(), b.keypoints.data(), a.size() * sizeof(Keypoint)) == 0;
}

const Keypoint* nearest(const FeatureSet& features, const Blob& blob, double radius) {
  const Keypoint* best = nullptr;
  for (const Keypoint& k : features.keypoints) {
    const double distance = std::hypot(k.x - blob.x, k.y - blob.y);
    if (distance > radius || k.scale < 0.5 * blob.sigma || k.scale > 2 * blob.sigma) continue;
    if (!best || k.response > best->response) best = &k;
  }
  return best;
}

TEST_CASE("SIFT finds blobs of every size where they are") {
  std::mt19937 random(7);
  const auto unit = [&] { return static_cast<double>(random()) / 4294967296.0; };
  for (const double sigma : {1.5, 2.0, 2.5, 3.6, 5.0, 8.0}) {
    std::vector<Blob> blobs;
    const double spacing = std::max(30.0, 12 * sigma);
    for (int row = 0; row < 5; ++row) {
      for (int column = 0; column < 8; ++column) {
        blobs.push_back(
            {(column + 1) * spacing + 8 * unit(), (row + 1) * spacing + 8 * unit(), sigma});
      }
    }
    const GrayImage image =
        blob_image(static_cast<int>(9 * spacing), static_cast<int>(6 * spacing), blobs, 120);
    const FeatureSet features = make_sift({})->extract(image, nullptr);
    double sum_x = 0, sum_y = 0, largest = 0;
    for (const Blob& blob : blobs) {
      const Keypoint* k = nearest(features, blob, 1.0);
      REQUIRE(k);
      sum_x += k->x - blob.x;
      sum_y += k->y - blob.y;
      largest = std::max({largest, std::abs(k->x - blob.x), std::abs(k->y - blob.y)});
    }
    const auto count = static_cast<double>(blobs.size());
    INFO("sigma " << sigma << ": mean error " << sum_x / count << ", " << sum_y / count
                  << ", largest " << largest);
    CHECK(std::abs(sum_x / count) < 0.02);
    CHECK(std::abs(sum_y / count) < 0.02);
    CHECK(largest < 0.1 * std::max(1.0, sigma));
  }
}

// Peak |difference of Gaussians| of a blob, in grey levels, over continuous scale. `input_blur`:
// what SIFT takes the image to carry already.
double peak_response(double amplitude, double sigma, int layers, double* scale) {
  const double k = std::exp2(1.0 / layers);
  constexpr double kInputBlur2 = 0.25;
  double best = 0;
  for (double s = 0.5; s < 20; s += 0.001) {
    const double s2 = sigma * sigma;
    const double value =
        amplitude * s2 * (1 / (s2 + s * s - kInputBlur2) - 1 / (s2 + k * k * s * s - kInputBlur2));
    if (value > best) {
      best = value;
      *scale = s;
    }
  }
  return best;
}

TEST_CASE("SIFT's response is in grey levels, its scale in pixels, its threshold in both senses") {
  const Blob blob{50.3, 50.4, 3.0};
  const GrayImage image = blob_image(101, 101, {blob}, 100);
  for (const int layers : {3, 5}) {
    double scale = 0;
    const double expected = peak_response(100, blob.sigma, layers, &scale);
    SiftOptions options;
    options.octave_layers = layers;
    const FeatureSet features = make_sift(options)->extract(image, nullptr);
    const Keypoint* k = nearest(features, blob, 1.0);
    REQUIRE(k);
    CHECK(k->response == Approx(expected).epsilon(0.03));
    CHECK(k->scale == Approx(scale).epsilon(0.05));
    CHECK(k->sigma == Approx(0.5 * std::sqrt(1 + k->scale * k->scale / 16)));

    options.contrast_threshold = 0.97 * k->response;
    CHECK(nearest(make_sift(options)->extract(image, nullptr), blob, 1.0) != nullptr);
    options.contrast_threshold = 1.03 * k->response;
    CHECK(nearest(make_sift(options)->extract(image, nullptr), blob, 1.0) == nullptr);
  }
}

TEST_CASE("SIFT's angle turns from +x towards +y") {
  for (int degrees = 15; degrees < 360; degrees += 30) {
    const double angle = degrees * std::numbers::pi / 180;
    const Blob blob{60, 60, 3.0};
    // A blob on a slope that brightens in the direction of the angle.
    const GrayImage image = to_image(121, 121, [&](double x, double y) {
      const double along = (x - blob.x) * std::cos(angle) + (y - blob.y) * std::sin(angle);
      const double r2 = (x - blob.x) * (x - blob.x) + (y - blob.y) * (y - blob.y);
      return 128 + along + 60 * std::exp(-r2 / (2 * blob.sigma * blob.sigma));
    });
    const FeatureSet features = make_sift({})->extract(image, nullptr);
    double closest = 10;
    for (const Keypoint& k : features.keypoints) {
      if (std::hypot(k.x - blob.x, k.y - blob.y) > 3) continue;
      CHECK(k.angle >= 0);
      CHECK(k.angle < 2 * std::numbers::pi);
      closest = std::min(closest, std::abs(std::remainder(k.angle - angle, 2 * std::numbers::pi)));
    }
    CHECK(closest < 0.3);  // the slope moves the place, OpenCV's bins have 10 degrees
  }
}

TEST_CASE("SIFT's descriptors are RootSIFT of length 512") {
  const FeatureSet features = make_sift({})->extract(texture(320, 240, 3), nullptr);
  REQUIRE(features.size() > 100);
  REQUIRE(features.descriptors.size() == features.size());
  CHECK(features.kind == DescriptorKind::kRootSiftOpenCv);
  for (const Descriptor& descriptor : features.descriptors) {
    double sum = 0;
    for (const std::uint8_t byte : descriptor) sum += byte * byte;
    CHECK(std::sqrt(sum) == Approx(512).epsilon(0.02));
  }
}

TEST_CASE("SIFT repeats itself bit for bit, in one instance and in another") {
  const GrayImage image = texture(320, 240, 4);
  SiftOptions options;
  options.max_features = 300;
  const auto one = make_sift(options);
  const FeatureSet first = one->extract(image, nullptr);
  REQUIRE(first.size() == 300);
  one->extract(texture(100, 90, 5), nullptr);
  CHECK(same_bytes(first, one->extract(image, nullptr)));
  CHECK(same_bytes(first, make_sift(options)->extract(image, nullptr)));
}

TEST_CASE("SIFT describes a feature alike whatever else was found") {
  const GrayImage image = texture(320, 240, 4);
  SiftOptions options;
  options.max_features = 100000;
  const FeatureSet all = make_sift(options)->extract(image, nullptr);
  options.max_features = 200;
  const FeatureSet some = make_sift(options)->extract(image, nullptr);
  REQUIRE(all.size() > 400);
  REQUIRE(some.size() == 200);
  std::set<Descriptor> described(all.descriptors.begin(), all.descriptors.end());
  for (const Descriptor& descriptor : some.descriptors) CHECK(described.count(descriptor) == 1);
}

TEST_CASE("SIFT keeps out of the mask") {
  const GrayImage image = texture(320, 240, 6);
  GrayImage mask{320, 240, std::vector<std::uint8_t>(320 * 240, 255)};
  for (int y = 0; y < 240; ++y) std::fill_n(mask.row(y) + 100, 80, std::uint8_t{0});
  const FeatureSet features = make_sift({})->extract(image, &mask);
  int left = 0, right = 0;
  for (const Keypoint& k : features.keypoints) {
    CHECK((k.x < 99.5 || k.x > 179.5));
    left += k.x < 99.5;
    right += k.x > 179.5;
  }
  CHECK(left > 50);
  CHECK(right > 50);
}

TEST_CASE("SIFT finds nothing where there is nothing") {
  const auto sift = make_sift({});
  for (const int size : {0, 1, 7, 11, 12, 13, 64, 300}) {
    const GrayImage flat{size, size,
                         std::vector<std::uint8_t>(static_cast<std::size_t>(size * size), 90)};
    const FeatureSet features = sift->extract(flat, nullptr);
    CHECK(features.size() == 0);
    CHECK(features.descriptors.empty());
  }
}

TEST_CASE("SIFT without upsampling leaves out the finest features") {
  const std::vector<Blob> blobs = {{60.3, 60.2, 1.5}, {160.1, 60.4, 6.0}};
  const GrayImage image = blob_image(220, 121, blobs, 120);
  SiftOptions options;
  CHECK(nearest(make_sift(options)->extract(image, nullptr), blobs[0], 1) != nullptr);
  options.upsample = false;
  const FeatureSet features = make_sift(options)->extract(image, nullptr);
  CHECK(nearest(features, blobs[0], 1) == nullptr);
  CHECK(nearest(features, blobs[1], 1) != nullptr);
}

TEST_CASE("SIFT refuses options and images that cannot be") {
  SiftOptions options;
  options.max_features = 0;
  CHECK_THROWS_AS(make_sift(options), std::invalid_argument);
  options = {};
  options.contrast_threshold = std::nan("");
  CHECK_THROWS_AS(make_sift(options), std::invalid_argument);
  const GrayImage image = texture(40, 40, 1);
  const GrayImage mask = texture(40, 39, 1);
  CHECK_THROWS_AS(make_sift({})->extract(image, &mask), std::logic_error);
  CHECK_THROWS_AS(make_sift({})->extract({40, 40, {}}, nullptr), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
