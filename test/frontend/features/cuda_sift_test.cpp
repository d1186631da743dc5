// The kernels of the CUDA engine, run on the host, against the CPU engine. Every kernel is run with
// its threads and blocks in both orders: what differs would be a race on a device.
#include <algorithm>
#include <cmath>
#include <random>
#include <tuple>
#include <vector>

#include <catch2/catch.hpp>
#include "frontend/features/cpu/cpu_sift.h"
#include "frontend/features/feature_selection.h"
#include "test/frontend/features/feature_agreement.h"
#include "test/frontend/features/host_cuda_sift.h"
#include "test/frontend/features/test_images.h"

namespace hybrid_slam::cuda {
namespace {

// In both orders of threads and blocks.
FeatureSet extract(const SiftOptions& options, const GrayImage& image, const GrayImage* mask) {
  FeatureSet features = HostCudaSift(options).extract(image, mask);
  CHECK(same_bytes(features, HostCudaSift(options, true).extract(image, mask)));
  return features;
}

void check_agreement(const SiftOptions& options, const GrayImage& image, const GrayImage* mask) {
  const FeatureSet ours = extract(options, image, mask);
  const FeatureSet cpu = CpuSift(options).extract(image, mask);
  CHECK(ours.kind == cpu.kind);
  CHECK(std::abs(std::ssize(ours.keypoints) - std::ssize(cpu.keypoints)) <=
        std::ssize(cpu.keypoints) / 100 + 1);
  for (const auto& [a, b] : {std::tie(ours, cpu), std::tie(cpu, ours)}) {
    const FeatureAgreement agreement = feature_agreement(a, b);
    CHECK(agreement.found >= (a.size() < 50 ? 0.95 : 0.98));
    CHECK(agreement.median_angle < 0.1);
    CHECK(agreement.median_descriptor_angle < 0.2);
    CHECK(agreement.worst_byte <= 8);
  }
}

TEST_CASE("CUDA's SIFT finds what the CPU's finds") {
  std::mt19937 random(1);
  for (int trial = 0; trial < 6; ++trial) {
    const auto between = [&](int low, int high) {
      return low + static_cast<int>(random() % static_cast<unsigned>(high - low + 1));
    };
    const int width = between(64, 400) | (trial % 2);
    const int height = between(64, 240);
    SiftOptions options;
    options.upsample = trial % 4 == 0;
    options.max_features = trial < 2 ? 20 : between(100, 900);
    INFO(width << " x " << height << ", N = " << options.max_features << ", upsampling "
               << options.upsample);
    check_agreement(options, texture(width, height, static_cast<unsigned>(trial)), nullptr);
  }
}

TEST_CASE("CUDA's SIFT follows the options as the CPU's does") {
  const GrayImage image = texture(151, 110, 5);
  SiftOptions options;
  options.upsample = false;
  SECTION("layers") { options.octave_layers = GENERATE(1, 2, 5, 10); }
  SECTION("blur") { options.initial_sigma = GENERATE(1.2, 2.5); }
  SECTION("no contrast") { options.contrast_threshold = 0; }
  SECTION("edges") { options.edge_threshold = 3; }
  check_agreement(options, image, nullptr);
}

TEST_CASE("CUDA's SIFT keeps out of the mask as the CPU's does") {
  GrayImage mask{211, 170, std::vector<std::uint8_t>(211 * 170, 0)};
  for (int y = 20; y < 150; ++y) std::fill_n(mask.row(y) + 30, 97, std::uint8_t{1});
  const GrayImage image = texture(211, 170, 6);
  SiftOptions options;
  options.upsample = false;
  check_agreement(options, image, &mask);
  // One instance goes from mask to none and back.
  HostCudaSift sift(options);
  const std::size_t whole = sift.extract(image, nullptr).size();
  const std::size_t part = sift.extract(image, &mask).size();
  CHECK(part > 20);
  CHECK(part < whole / 2);
  CHECK(sift.extract(image, nullptr).size() == whole);
}

TEST_CASE("CUDA's SIFT has the scale space of the CPU's") {
  for (const bool upsample : {false, true}) {
    const GrayImage image = texture(131, 90, 7);
    SiftOptions options;
    options.upsample = upsample;
    SiftEngine<OnHost> engine(options);
    engine.start(image, nullptr);
    sift::ScaleSpace expected(options);
    expected.detect(image);
    const ScaleSpace& ours = engine.scale_space();
    REQUIRE(ours.octaves == (upsample ? 5 : 4));
    float largest = 0;
    for (int octave = 0; octave < ours.octaves; ++octave) {
      for (int level = 1; level <= ours.layers; ++level) {
        const sift::LevelView a = ours.octave[octave].level(level);
        const sift::FixedLevel b = expected.level(octave, level);
        REQUIRE(a.width == b.width);
        REQUIRE(a.height == b.height);
        for (int y = 0; y < a.height; ++y) {
          for (int x = 0; x < a.width; ++x) {
            const float theirs = b.samples[y * b.stride + x] / sift::kLevelUnits;
            largest = std::max(largest, std::abs(a.samples[y * a.stride + x] - theirs));
          }
        }
      }
    }
    CHECK(largest < 0.5F / sift::kLevelUnits + 2e-4F);
    engine.finish();
  }
}

TEST_CASE("CUDA's SIFT makes room where an image has very many extrema") {
  std::mt19937 random(8);
  GrayImage noise{200, 150, {}};
  for (int i = 0; i < 200 * 150; ++i) {
    noise.pixels.push_back(random() % 2 ? 255 : 0);
  }
  SiftOptions options;
  options.initial_sigma = 0.4;
  options.contrast_threshold = 0;
  options.edge_threshold = 1e6;
  options.max_features = 100000;
  options.upsample = false;
  const FeatureSet all = extract(options, noise, nullptr);
  CHECK(all.size() > 200 * 150 / 24 + 1024);
  const FeatureSet cpu = CpuSift(options).extract(noise, nullptr);
  CHECK(std::abs(std::ssize(all.keypoints) - std::ssize(cpu.keypoints)) < 40);
}

TEST_CASE("CUDA's SIFT takes as much memory as docs/sift.md says") {
  for (const bool upsample : {false, true}) {
    SiftOptions options;
    options.upsample = upsample;
    options.max_features = 1000;
    HostCudaSift sift(options);
    const auto bytes = [&] { return static_cast<double>(sift.engine().backend().device_bytes()); };
    sift.extract(texture(320, 240, 9), nullptr);
    const double samples = 320 * 240 * (upsample ? 4 : 1);
    CHECK(bytes() == Approx(57 * samples + 300 * options.max_features + 2e5).epsilon(0.03));
    const double before = bytes();
    sift.extract(texture(160, 120, 9), nullptr);
    CHECK(bytes() < before / 2);  // what the larger image needed is given back
  }
}

// Sorts and selects extrema as the engine does, in both orders; returns indices.
std::vector<int> select(const std::vector<Keypoint>& keypoints, int width, int height,
                        int max_count, bool backward) {
  OnHost host(backward);
  const auto ints = [&](std::size_t count) {
    auto* const memory = static_cast<int*>(host.allocate(count * sizeof(int)));
    std::fill_n(memory, count, 0);
    return memory;
  };
  const std::size_t count = keypoints.size();
  std::vector<Extremum> found(count), bucketed(count), sorted(count);
  std::vector<Extremum> selected(static_cast<std::size_t>(max_count));
  for (std::size_t i = 0; i < count; ++i) {
    const Keypoint& k = keypoints[i];
    found[i] = {k.x, k.y, k.scale, k.response, static_cast<float>(i), 0, 0, 0, 0};
  }
  int total = static_cast<int>(count);
  Sorting sorting{};
  sorting.found = {&total, total, found.data(), ints(kBuckets)};
  for (const Keypoint& k : keypoints) ++sorting.found.bucket_sizes[bucket_of(k.response)];
  sorting.cursors = ints(kBuckets);
  sorting.bucket_firsts = ints(kBuckets);
  sorting.bucketed = bucketed.data();
  sorting.sorted = sorted.data();
  sorting.count = ints(1);
  Spread& spread = sorting.spread;
  spread.grid = make_spread_grid(width, height, max_count);
  spread.max_count = max_count;
  spread.strongest = strongest_count(max_count);
  spread.count = sorting.count;
  const auto cells = static_cast<std::size_t>(spread.grid.cells());
  for (int** of_cells : {&spread.cell_sizes, &spread.taken, &spread.cursors, &spread.cell_firsts}) {
    *of_cells = ints(cells);
  }
  std::vector<unsigned> kept(count / 32 + 1);
  spread.kept = kept.data();
  spread.cells = ints(count);
  spread.members = ints(count);
  spread.kept_before = ints(count / 32 + 1);
  spread.quota = ints(1);
  spread.kept_count = ints(1);
  host.launch({1}, PlaceBuckets{sorting});
  host.launch({3}, FillBuckets{sorting});
  host.launch({3}, SortBuckets{sorting});
  host.launch({1}, FindQuota{spread});
  host.launch({3}, ListMembers{spread});
  host.launch({3}, KeepItems{spread});
  host.launch({1}, CountKept{spread});
  host.launch({3}, GatherExtrema{sorting, selected.data()});
  std::vector<int> indices;
  for (int i = 0; i < spread.selected(); ++i) {
    indices.push_back(static_cast<int>(selected[static_cast<std::size_t>(i)].level_x));
  }
  return indices;
}

TEST_CASE("CUDA's selection is select_spread()") {
  std::mt19937 random(9);
  const auto unit = [&] { return static_cast<float>(random() % 65536) / 65536; };
  for (const int count : {0, 1, 31, 32, 1500, 4000}) {
    for (const bool crowded : {false, true}) {
      std::vector<Keypoint> keypoints;
      for (int i = 0; i < count; ++i) {
        Keypoint k;
        k.x = (crowded && i % 4 ? 60 : 639) * unit();
        k.y = 470 * unit();
        k.scale = 1 + unit();
        // Many equal ones, and such that are beyond the buckets.
        k.response = i % 3 ? static_cast<float>(random() % 20) : 1e-4F + 300 * unit() * unit();
        keypoints.push_back(k);
      }
      for (const int max_count : {1, 7, 1000, 1024 * 9}) {
        INFO(count << " keypoints, crowded " << crowded << ", N = " << max_count);
        const std::vector<int> expected = select_spread(keypoints, 640, 480, max_count);
        CHECK(select(keypoints, 640, 480, max_count, false) == expected);
        CHECK(select(keypoints, 640, 480, max_count, true) == expected);
      }
    }
  }
}

TEST_CASE("CUDA's SIFT refuses blurs that reach too far") {
  SiftOptions options;
  options.initial_sigma = 3.0;
  CHECK_NOTHROW(SiftEngine<OnHost>(options));
  CHECK(why_blurs_too_large(options).empty());
  for (const double sigma : {4.0, 1e6, 1e300}) {
    options.initial_sigma = sigma;
    CHECK_FALSE(why_blurs_too_large(options).empty());
    CHECK_THROWS_AS(SiftEngine<OnHost>(options), std::invalid_argument);
  }
}

}  // namespace
}  // namespace hybrid_slam::cuda
