#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include <catch2/catch.hpp>

#include "apps/feature_eval/methods/onnx_methods.h"
#include "cameras/files/input_error.h"
#include "test/apps/feature_study/onnx_file.h"
#include "test/frontend/features/test_images.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

// Writes both files and opens them.
std::unique_ptr<FeatureMethod> open(const TempFolder& folder, const std::string& onnx,
                                    const std::string& yaml, int features = 2000) {
  write_text(folder.path() / "net.onnx", onnx);
  write_text(folder.path() / "net.yaml", "model: net.onnx\n" + yaml);
  SiftOptions sift;
  sift.max_features = features;
  return make_onnx_method(read_onnx_contract((folder.path() / "net.yaml").string()), sift);
}

const FloatDescriptors& numbers_of(const DescribedFeatures& features) {
  return std::get<FloatDescriptors>(features.descriptors);
}

TEST_CASE("a patch is cut along the keypoint's angle, as wide as the contract says") {
  const GrayImage ramp = to_image(200, 160, [](double x, double y) { return 0.5 * x + y; });
  OnnxContract contract;
  contract.width = contract.height = 8;
  contract.patch_scales = 12;
  Keypoint keypoint;
  keypoint.x = 90;
  keypoint.y = 70;
  keypoint.scale = 2;  // a side of 24 px, samples 3 px apart, of the image halved once
  const std::vector<float> straight = cut_patch(ramp, keypoint, contract);
  keypoint.angle = static_cast<float>(std::numbers::pi / 2);
  const std::vector<float> turned = cut_patch(ramp, keypoint, contract);
  REQUIRE(straight.size() == 64);
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 8; ++column) {
      const double dx = 3 * (column - 3.5), dy = 3 * (row - 3.5);
      const auto i = static_cast<std::size_t>(8 * row + column);
      CHECK(straight[i] == Approx(0.5 * (90 + dx) + 70 + dy).margin(0.3));
      CHECK(turned[i] == Approx(0.5 * (90 - dy) + 70 + dx).margin(0.3));  // x of the patch is y
    }
  }
}

TEST_CASE("a patch descriptor is what the network makes of each normalised patch, in batches") {
  const TempFolder folder;
  const GrayImage image = texture(200, 160, 8);
  const auto method = open(folder, onnx_bytes(block_means(5, 8, 8, 4, 2)),
                           "kind: patch_descriptor\n"
                           "input: {width: 8, height: 8, scale: 0.01, mean: 0.5, deviation: 2}\n"
                           "descriptor: {length: 8, distance: l2}\n"
                           "patch: {scales: 9, batch: 5}\n",
                           52);  // the last batch holds two
  StageTimes times;
  const DescribedFeatures features = method->extract(image, nullptr, times);
  REQUIRE(features.size() == 52);
  REQUIRE(numbers_of(features).length == 8);
  REQUIRE(numbers_of(features).values.size() == 52 * 8);
  SiftOptions sift;
  sift.max_features = 52;
  const FeatureSet ours = make_sift(sift)->extract(image, nullptr);
  OnnxContract contract;
  contract.width = contract.height = 8;
  contract.patch_scales = 9;
  for (std::size_t i = 0; i < features.size(); ++i) {
    CHECK(features.keypoints[i].x == ours.keypoints[i].x);
    const std::vector<float> patch = cut_patch(image, ours.keypoints[i], contract);
    for (std::size_t block = 0; block < 8; ++block) {  // 2 across, 4 down
      double sum = 0;
      for (std::size_t y = 0; y < 2; ++y) {
        for (std::size_t x = 0; x < 4; ++x) {
          sum += patch[(block / 2 * 2 + y) * 8 + block % 2 * 4 + x];
        }
      }
      CHECK(numbers_of(features).values[8 * i + block] ==
            Approx((0.01 * sum / 8 - 0.5) / 2).margin(1e-4));
    }
  }
}

TEST_CASE("patches can lose their mean and contrast, and descriptors their length") {
  const TempFolder folder;
  const GrayImage image = texture(200, 160, 8);
  StageTimes times;
  const std::string input =
      "kind: patch_descriptor\ninput: {width: 8, height: 8, per_patch: true}\n";
  const auto raw = open(folder, onnx_bytes(block_means(1, 8, 8, 1, 1)),
                        input + "descriptor: {length: 64, distance: l2}\n")
                       ->extract(image, nullptr, times);
  const auto unit = open(folder, onnx_bytes(block_means(1, 8, 8, 1, 1)),
                         input + "descriptor: {length: 64, distance: cosine}\n")
                        ->extract(image, nullptr, times);
  REQUIRE(raw.size() > 50);
  for (std::size_t i = 0; i < raw.size(); ++i) {
    const float* const values = &numbers_of(raw).values[64 * i];
    const float* const units = &numbers_of(unit).values[64 * i];
    CHECK(std::accumulate(values, values + 64, 0.0) == Approx(0).margin(1e-3));
    CHECK(std::inner_product(values, values + 64, values, 0.0) == Approx(64).epsilon(1e-3));
    for (std::size_t k = 0; k < 64; ++k) CHECK(units[k] == Approx(values[k] / 8).margin(1e-4));
  }
}

TEST_CASE("patch descriptors match a shifted image, as SIFT's do") {
  const TempFolder folder;
  const GrayImage image = texture(260, 220, 5);
  const auto cut = [&](int left, int top) {
    return to_image(220, 190, [&](double x, double y) {
      return image.row(static_cast<int>(y) + top)[static_cast<int>(x) + left];
    });
  };
  const auto method = open(folder, onnx_bytes(block_means(16, 32, 32, 4, 2)),
                           "kind: patch_descriptor\ninput: {per_patch: true}\n"
                           "descriptor: {length: 128}\npatch: {batch: 16}\nratio: 0.9\n");
  StageTimes times;
  const auto a = method->extract(cut(0, 0), nullptr, times);
  const auto b = method->extract(cut(7, 4), nullptr, times);
  const auto matches = method->match(a, b, times);
  REQUIRE(matches.size() > 100);
  const auto right = std::count_if(matches.begin(), matches.end(), [&](const FeatureMatch& m) {
    const Keypoint& from = a.keypoints[static_cast<std::size_t>(m.query)];
    const Keypoint& to = b.keypoints[static_cast<std::size_t>(m.train)];
    return std::hypot(from.x - to.x - 7, from.y - to.y - 4) < 0.5;
  });
  CHECK(static_cast<double>(right) > 0.9 * static_cast<double>(matches.size()));
}

// A ramp to the right with bright pixels.
GrayImage spots(int width, int height, const std::vector<std::pair<int, int>>& places) {
  GrayImage image = to_image(width, height, [](double x, double) { return x; });
  for (const auto& [x, y] : places) image.row(y)[x] = 200;
  return image;
}

TEST_CASE(
    "a dense detector's cells become pixels with the softmax's scores, and descriptors between") {
  const TempFolder folder;
  const auto method =
      open(folder, onnx_bytes(cell_detector(64, 48, 8)),
           "kind: dense_detector\ninput: {scale: 0.05}\ndescriptor: {length: 2, distance: l2}\n"
           "detector: {scores: cells, cell: 8, threshold: 0.1, radius: 3, border: 4}\n");
  // (21, 13) and (23, 13) are within each other's radius: the first one stays. (2, 30) lies on the
  // border.
  GrayImage image = spots(64, 48, {{21, 13}, {42, 33}, {2, 30}});
  image.row(13)[23] = 199;
  StageTimes times;
  const DescribedFeatures features = method->extract(image, nullptr, times);
  REQUIRE(features.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    const Keypoint& keypoint = features.keypoints[i];
    const bool upper = keypoint.y == 13;
    CHECK(keypoint.x == (upper ? 21 : 42));
    CHECK(keypoint.y == (upper ? 13 : 33));
    const int left = upper ? 16 : 40;
    double sum = std::exp(8.0);
    for (int column = 0; column < 8; ++column) sum += 8 * std::exp(0.05 * (left + column));
    sum += std::exp(10.0) - std::exp(0.05 * keypoint.x);
    if (upper) sum += std::exp(0.05 * 199) - std::exp(0.05 * 23);
    CHECK(keypoint.response == Approx(std::exp(10.0) / sum).epsilon(1e-4));
    // The first pixel of a cell is the ramp there, and stands for the cell's middle, 3.5 px on.
    CHECK(numbers_of(features).values[2 * i] == Approx(0.05 * (keypoint.x - 3.5)).epsilon(1e-4));
    CHECK(numbers_of(features).values[2 * i + 1] == Approx(1));
  }
  GrayImage mask = to_image(64, 48, [](double, double y) { return y < 20 ? 0 : 255; });
  CHECK(method->extract(image, &mask, times).size() == 1);
  const auto one = open(folder, onnx_bytes(cell_detector(64, 48, 8)),
                        "kind: dense_detector\ninput: {scale: 0.05}\ndescriptor: {length: 2}\n"
                        "detector: {threshold: 0.1}\n",
                        1);
  const DescribedFeatures strongest = one->extract(image, nullptr, times);
  REQUIRE(strongest.size() == 1);
  const float* const unit = numbers_of(strongest).values.data();
  CHECK(std::hypot(unit[0], unit[1]) == Approx(1));
}

TEST_CASE("a dense detector of another size than the image's tells places in the image") {
  const TempFolder folder;
  const auto method = open(folder, onnx_bytes(map_detector(160, 96)),
                           "kind: dense_detector\ninput: {width: 160, height: 96}\n"
                           "descriptor: {length: 3}\n"
                           "detector: {scores: map, cell: 1, threshold: 50, radius: 6}\n");
  // 60x48 becomes 120x96 of 160x96.
  const std::vector<Blob> blobs{{20.25, 15.25, 2}, {44.25, 30.75, 2}};
  const DescribedFeatures features = [&] {
    StageTimes times;
    return method->extract(blob_image(60, 48, blobs, 100), nullptr, times);
  }();
  for (const Blob& blob : blobs) {
    CHECK(std::any_of(features.keypoints.begin(), features.keypoints.end(), [&](const Keypoint& k) {
      return k.response > 120 && std::hypot(k.x - blob.x, k.y - blob.y) < 0.3;
    }));
  }
  for (const Keypoint& k : features.keypoints) CHECK((k.x < 60 && k.y < 48));
}

void check_refused(const TempFolder& folder, const std::string& onnx, const std::string& yaml,
                   const std::string& reason) {
  INFO(reason);
  try {
    open(folder, onnx, yaml);
    FAIL("was not refused");
  } catch (const InputError& error) {
    const std::string text = error.what();
    INFO(text);
    CHECK(text.find((folder.path() / "net.").string()) == 0);
    CHECK(text.find(reason) != std::string::npos);
    CHECK(text.find('\n') == std::string::npos);
  }
}

TEST_CASE("networks and contracts that cannot be used are refused with one line") {
  const TempFolder folder;
  const std::string good = onnx_bytes(block_means(1, 8, 8, 4, 2));
  const std::string yaml = "kind: patch_descriptor\ninput: {width: 8, height: 8}\n";
  const std::string length = "descriptor: {length: 8}\n";
  REQUIRE_NOTHROW(open(folder, good, yaml + length));
  check_refused(folder, "no network at all, but some text", yaml + length, "net.onnx: not an ONNX");
  check_refused(folder, "", yaml + length, "net.onnx: empty");
  check_refused(folder, good.substr(0, good.size() / 2), yaml + length, "net.onnx: not an ONNX");
  check_refused(folder, good, yaml + "descriptor: {length: 128}\n",
                "gives 1x8 for an input of 1x1x8x8, not 1x128");
  check_refused(folder, good,
                "kind: dense_detector\ninput: {width: 8, height: 8}\ndescriptor: {length: 8}\n",
                "net.onnx: ");
  OnnxGraph strange = block_means(1, 8, 8, 4, 2);
  strange.nodes.front().operation = "NoSuchOperation";
  check_refused(folder, onnx_bytes(strange), yaml + length, "net.onnx: ");
  const std::string cells = onnx_bytes(cell_detector(64, 48, 8));
  const std::string dense = "kind: dense_detector\ninput: {width: 64, height: 48}\n";
  REQUIRE_NOTHROW(open(folder, cells, dense + "descriptor: {length: 2}\n"));
  check_refused(folder, cells, dense + "descriptor: {length: 256}\n",
                "without descriptors of 1x256");
  check_refused(folder, cells, dense + "descriptor: {length: 2}\ndetector: {scores: map}\n",
                "without scores of 1x1x48x64");

  check_refused(folder, good, yaml, "descriptor: ");
  check_refused(folder, good, length, "kind: ");
  check_refused(folder, good, "kind: lightglue\n" + length, "net.yaml:2: kind: must be");
  check_refused(folder, good, yaml + length + "sice: 3\n", "sice: unknown key");
  check_refused(folder, good, yaml + "descriptor: {length: 0}\n", "descriptor.length: must be");
  check_refused(folder, good, yaml + length + "ratio: 1.5\n", "ratio: must be at most 1");
  check_refused(folder, good, yaml + length + "detector: {cell: 8}\n",
                "does not go with this kind");
  check_refused(folder, good, "kind: patch_descriptor\ninput: {deviation: 0}\n" + length,
                "input.deviation: must be positive");
  check_refused(folder, cells, "kind: dense_detector\ninput: {width: 60, height: 48}\n" + length,
                "multiples of the cell");
  REQUIRE_NOTHROW(open(folder, good, yaml + length));
  fs::remove(folder.path() / "net.onnx");
  CHECK_THROWS_WITH(make_onnx_method(read_onnx_contract((folder.path() / "net.yaml").string()), {}),
                    Catch::Contains("no such ONNX file"));
  CHECK_THROWS_AS(read_onnx_contract((folder.path() / "none.yaml").string()), InputError);
}

}  // namespace
}  // namespace hybrid_slam
