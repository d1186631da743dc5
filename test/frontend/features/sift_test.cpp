#include "frontend/features/sift.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <set>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include "apps/feature_eval/opencv_sift.h"
#include "frontend/features/sift_batch.h"
#include "frontend/features/sift_device.h"
#include "test/frontend/features/feature_agreement.h"
#include "test/frontend/features/host_cuda_sift.h"
#include "test/frontend/features/test_images.h"

namespace hybrid_slam {
namespace {

struct Engine {
  std::string name;
  DescriptorKind kind;
  std::function<std::unique_ptr<SiftExtractor>(const SiftOptions&)> make;
};

// What holds for every engine is tested on every one. OpenCV's is the reference for the others, and
// what the tests ask for is no more than it gives.
const std::vector<Engine>& engines() {
  static const std::vector<Engine> kEngines = [] {
    std::vector<Engine> list = {
        {"CPU", DescriptorKind::kRootSift, make_sift},
        {"CUDA's kernels on the host", DescriptorKind::kRootSift,
         [](const SiftOptions& options) { return std::make_unique<HostCudaSift>(options); }},
        {"OpenCV", DescriptorKind::kRootSiftOpenCv, make_opencv_sift},
    };
    if (why_no_cuda_sift({}).empty()) {
      list.push_back({"CUDA", DescriptorKind::kRootSift, [](const SiftOptions& options) {
                        return make_sift_on(SiftDevice::kCuda, options);
                      }});
    }
    return list;
  }();
  return kEngines;
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

// Peak |difference of Gaussians| of a blob, in grey levels, over continuous scale.
double peak_response(double amplitude, double sigma, int layers, double* scale) {
  const double k = std::exp2(1.0 / layers);
  constexpr double kInputBlur2 = sift::kImageBlur * sift::kImageBlur;
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
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  const Blob blob{50.3, 50.4, 3.0};
  const GrayImage image = blob_image(101, 101, {blob}, 100);
  for (const int layers : {3, 5}) {
    double scale = 0;
    const double expected = peak_response(100, blob.sigma, layers, &scale);
    SiftOptions options;
    options.octave_layers = layers;
    const FeatureSet features = engine.make(options)->extract(image, nullptr);
    const Keypoint* k = nearest(features, blob, 1.0);
    REQUIRE(k);
    CHECK(k->response == Approx(expected).epsilon(0.03));
    CHECK(k->scale == Approx(scale).epsilon(0.05));
    CHECK(k->sigma == Approx(0.5 * std::sqrt(1 + k->scale * k->scale / 16)));

    options.contrast_threshold = 0.97 * k->response;
    CHECK(nearest(engine.make(options)->extract(image, nullptr), blob, 1.0) != nullptr);
    options.contrast_threshold = 1.03 * k->response;
    CHECK(nearest(engine.make(options)->extract(image, nullptr), blob, 1.0) == nullptr);
  }
}

TEST_CASE("SIFT's angle turns from +x towards +y") {
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  for (int degrees = 15; degrees < 360; degrees += 30) {
    const double angle = degrees * std::numbers::pi / 180;
    const Blob blob{60, 60, 3.0};
    // A blob on a slope that brightens in the direction of the angle.
    const GrayImage image = to_image(121, 121, [&](double x, double y) {
      const double along = (x - blob.x) * std::cos(angle) + (y - blob.y) * std::sin(angle);
      const double r2 = (x - blob.x) * (x - blob.x) + (y - blob.y) * (y - blob.y);
      return 128 + along + 60 * std::exp(-r2 / (2 * blob.sigma * blob.sigma));
    });
    const FeatureSet features = engine.make({})->extract(image, nullptr);
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
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  const FeatureSet features = engine.make({})->extract(texture(320, 240, 3), nullptr);
  REQUIRE(features.size() > 100);
  REQUIRE(features.descriptors.size() == features.size());
  CHECK(features.kind == engine.kind);
  for (const Descriptor& descriptor : features.descriptors) {
    double sum = 0;
    for (const std::uint8_t byte : descriptor) sum += byte * byte;
    CHECK(std::sqrt(sum) == Approx(512).epsilon(0.02));
  }
}

TEST_CASE("SIFT repeats itself bit for bit, in one instance and in another") {
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  const GrayImage image = texture(320, 240, 4);
  SiftOptions options;
  options.max_features = 300;
  const auto one = engine.make(options);
  const FeatureSet first = one->extract(image, nullptr);
  REQUIRE(first.size() == 300);
  one->extract(texture(100, 90, 5), nullptr);
  CHECK(same_bytes(first, one->extract(image, nullptr)));
  CHECK(same_bytes(first, engine.make(options)->extract(image, nullptr)));
}

TEST_CASE("SIFT describes a feature alike whatever else was found") {
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  const GrayImage image = texture(320, 240, 4);
  SiftOptions options;
  options.max_features = 100000;
  const FeatureSet all = engine.make(options)->extract(image, nullptr);
  options.max_features = 200;
  const FeatureSet some = engine.make(options)->extract(image, nullptr);
  REQUIRE(all.size() > 400);
  REQUIRE(some.size() == 200);
  std::set<Descriptor> described(all.descriptors.begin(), all.descriptors.end());
  for (const Descriptor& descriptor : some.descriptors) CHECK(described.count(descriptor) == 1);
}

TEST_CASE("SIFT keeps out of the mask") {
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  const GrayImage image = texture(320, 240, 6);
  GrayImage mask{320, 240, std::vector<std::uint8_t>(320 * 240, 255)};
  for (int y = 0; y < 240; ++y) std::fill_n(mask.row(y) + 100, 80, std::uint8_t{0});
  const FeatureSet features = engine.make({})->extract(image, &mask);
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
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  const auto sift = engine.make({});
  for (const int size : {0, 1, 7, 11, 12, 13, 64, 300}) {
    const GrayImage flat{size, size,
                         std::vector<std::uint8_t>(static_cast<std::size_t>(size * size), 90)};
    const FeatureSet features = sift->extract(flat, nullptr);
    CHECK(features.size() == 0);
    CHECK(features.descriptors.empty());
  }
}

TEST_CASE("SIFT without upsampling leaves out the finest features") {
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  const std::vector<Blob> blobs = {{60.3, 60.2, 1.5}, {160.1, 60.4, 6.0}};
  const GrayImage image = blob_image(220, 121, blobs, 120);
  SiftOptions options;
  CHECK(nearest(engine.make(options)->extract(image, nullptr), blobs[0], 1) != nullptr);
  options.upsample = false;
  const FeatureSet features = engine.make(options)->extract(image, nullptr);
  CHECK(nearest(features, blobs[0], 1) == nullptr);
  CHECK(nearest(features, blobs[1], 1) != nullptr);
}

TEST_CASE("SIFT on a device that cannot be used is refused, on the CPU it is the CPU's") {
  const GrayImage image = texture(90, 80, 7);
  CHECK(same_bytes(make_sift_on(SiftDevice::kCpu, {})->extract(image, nullptr),
                   make_sift({})->extract(image, nullptr)));
  CHECK(to_string(SiftDevice::kCpu) == "cpu");
  CHECK(to_string(SiftDevice::kCuda) == "cuda");
  const std::string why_not = why_no_cuda_sift({});
  CHECK(why_not.find('\n') == std::string::npos);
  if (!why_not.empty()) CHECK_THROWS_AS(make_sift_on(SiftDevice::kCuda, {}), std::runtime_error);
  SiftOptions blurred;
  blurred.initial_sigma = 10;
  CHECK_FALSE(why_no_cuda_sift(blurred).empty());
}

TEST_CASE("SIFT in two steps, and of several images at a time, is that of each image") {
  const GrayImage images[] = {texture(120, 90, 1), texture(120, 90, 2), texture(120, 90, 3)};
  GrayImage mask{120, 90, std::vector<std::uint8_t>(120 * 90, 1)};
  std::fill_n(mask.pixels.begin(), 120 * 45, std::uint8_t{0});
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  const auto one = engine.make({}), other = engine.make({});
  one->start(images[0], &mask);
  other->start(images[1], nullptr);
  const FeatureSet first = one->finish();
  CHECK(first.size() > 20);
  CHECK(same_bytes(first, engine.make({})->extract(images[0], &mask)));
  CHECK(same_bytes(other->finish(), engine.make({})->extract(images[1], nullptr)));

  const std::vector<const GrayImage*> all{&images[2], &images[0], &images[1]};
  SiftBatch batch(SiftDevice::kCpu, {}, 2);
  const std::vector<FeatureSet> found = batch.extract(all, &mask);
  REQUIRE(found.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(same_bytes(found[i], make_sift({})->extract(*all[i], &mask)));
  }
  CHECK(batch.device_times().empty());
}

TEST_CASE("SIFT refuses options and images that cannot be") {
  const Engine engine = GENERATE(from_range(engines()));
  INFO(engine.name);
  SiftOptions options;
  options.max_features = 0;
  CHECK_THROWS_AS(engine.make(options), std::invalid_argument);
  options = {};
  options.contrast_threshold = std::nan("");
  CHECK_THROWS_AS(engine.make(options), std::invalid_argument);
  const GrayImage image = texture(40, 40, 1);
  const GrayImage mask = texture(40, 39, 1);
  CHECK_THROWS_AS(engine.make({})->extract(image, &mask), std::logic_error);
  CHECK_THROWS_AS(engine.make({})->extract({40, 40, {}}, nullptr), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
