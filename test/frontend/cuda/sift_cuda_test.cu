// The kernels on the device against the same kernels on the host, which the project's tests compare
// with the CPU engine:
//   sift_cuda_test [--quick]
// --quick: few and small images, for a sanitizer. Exit code 0: all passed, 1: some failed, 2: bad
// usage, 77: no CUDA device.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <exception>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "frontend/features/cuda/cuda_sift.h"
#include "frontend/features/cuda/on_device.cuh"
#include "frontend/features/cuda/on_host.h"
#include "frontend/features/cuda/sift_engine.h"
#include "frontend/matching/cuda/cuda_matcher.h"
#include "frontend/matching/cuda/matcher_engine.h"
#include "test/frontend/cuda/program_images.h"

namespace hybrid_slam::cuda {
namespace {

int failures = 0;

void expect(bool passed, const char* what) {
  if (passed) return;
  std::printf("FAILED: %s\n", what);
  ++failures;
}

bool same_bytes(const FeatureSet& a, const FeatureSet& b) {
  return a.size() == b.size() && a.descriptors == b.descriptors &&
         std::memcmp(a.keypoints.data(), b.keypoints.data(), a.size() * sizeof(Keypoint)) == 0;
}

// Share of the first's features that the second has, with much the same descriptor.
double share_found(const FeatureSet& a, const FeatureSet& b) {
  std::size_t found = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = 0; j < b.size(); ++j) {
      const Keypoint& k = a.keypoints[i];
      const Keypoint& other = b.keypoints[j];
      if (std::hypot(k.x - other.x, k.y - other.y) > 0.1) continue;
      if (std::abs(k.scale / other.scale - 1) > 0.02) continue;
      if (std::abs(std::remainder(k.angle - other.angle, 6.283185307)) > 0.035) continue;
      int square = 0;
      for (std::size_t d = 0; d < 128; ++d) {
        const int difference = a.descriptors[i][d] - b.descriptors[j][d];
        square += difference * difference;
      }
      if (square > 26 * 26) continue;  // a twentieth of a descriptor's length
      ++found;
      break;
    }
  }
  return a.size() == 0 ? 1 : static_cast<double>(found) / static_cast<double>(a.size());
}

// What a kernel reads or leaves without having been written is NaN, and far off as an integer.
class PoisonedDevice : public OnDevice {
 public:
  void* allocate(std::size_t bytes) {
    void* const memory = OnDevice::allocate(bytes);
    check(cudaMemsetAsync(memory, OnHost::kPoison, bytes, stream()), "poison");
    return memory;
  }
  void* allocate_for_host(std::size_t bytes) {
    return std::memset(OnDevice::allocate_for_host(bytes), OnHost::kPoison, bytes);
  }
};

struct Trial {
  int width;
  int height;
  SiftOptions options;
  GrayImage image;
  GrayImage mask;  // empty: none

  const GrayImage* mask_if_any() const { return mask.empty() ? nullptr : &mask; }
};

Trial make_trial(int number, int largest, std::mt19937& random) {
  const auto side = [&] { return 64 + static_cast<int>(random() % (largest - 63)); };
  Trial trial{side() | (number % 2), side(), {}, {}, {}};
  trial.options.upsample = number % 2 == 0 && trial.width * trial.height < 1000000;
  trial.options.max_features = number % 5 == 0 ? 10 : 500 * (1 + number % 4);
  trial.image = made_image(trial.width, trial.height, static_cast<unsigned>(number));
  if (number % 3 != 0) return trial;
  trial.mask = trial.image;
  const std::size_t third = trial.mask.pixels.size() / 3;
  std::fill(trial.mask.pixels.begin(), trial.mask.pixels.end(), std::uint8_t{1});
  std::fill_n(trial.mask.pixels.begin(), third, std::uint8_t{0});
  return trial;
}

SiftOptions plain_options() {
  SiftOptions options;
  options.upsample = false;
  return options;
}

template <typename Engine>
FeatureSet extract(Engine& engine, const Trial& trial) {
  engine.start(trial.image, trial.mask_if_any());
  return engine.finish();
}

void test_features(const Trial& trial, CudaSift& reused) {
  SiftEngine<OnHost> host(trial.options);
  const FeatureSet expected = extract(host, trial);
  CudaSift one(trial.options), other(trial.options);
  one.start(trial.image, trial.mask_if_any());
  other.start(trial.image, trial.mask_if_any());
  const FeatureSet features = one.finish();
  const double found = share_found(expected, features);
  std::printf("%4d x %4d, N = %4d: %zu features, on the host %zu, %.4f of them found\n",
              trial.width, trial.height, trial.options.max_features, features.size(),
              expected.size(), found);
  const double least = expected.size() < 50 ? 0.9 : 0.98;
  expect(found >= least, "the host's features are found");
  expect(share_found(features, expected) >= least, "features are found by the host");
  expect(same_bytes(features, other.finish()), "two extractors at once agree");
  expect(same_bytes(features, extract(one, trial)), "a second run repeats the first");
  one.time(CudaTiming::kStages);
  expect(same_bytes(features, extract(one, trial)), "so does one without a graph");
  SiftEngine<PoisonedDevice> poisoned(trial.options);
  expect(same_bytes(features, extract(poisoned, trial)), "so does one in poisoned memory");
  CudaSift fresh(plain_options());
  expect(same_bytes(extract(fresh, trial), extract(reused, trial)),
         "an extractor goes from size to size");
}

void test_nothing() {
  CudaSift sift{SiftOptions{}};
  for (const int size : {0, 1, 7, 10, 11, 12, 64, 300}) {
    GrayImage flat{size, size, {}};
    flat.pixels.assign(static_cast<std::size_t>(size) * static_cast<std::size_t>(size), 90);
    expect(sift.extract(flat, nullptr).size() == 0, "nothing is found where there is nothing");
  }
}

template <typename Error, typename Action>
void expect_error(const Action& action, const char* what) {
  try {
    action();
    expect(false, what);
  } catch (const Error&) {
  }
}

void test_bad_input() {
  SiftOptions options;
  options.max_features = 0;
  expect_error<std::invalid_argument>([&] { CudaSift{options}; }, "N = 0 is refused");
  options = {};
  options.initial_sigma = 4;
  expect_error<std::invalid_argument>([&] { CudaSift{options}; }, "too much blur is refused");
  CudaSift sift{SiftOptions{}};
  const GrayImage image = made_image(80, 70, 1);
  const GrayImage mask = made_image(80, 69, 1);
  expect_error<std::logic_error>([&] { sift.extract(image, &mask); }, "the mask's size is checked");
  expect(sift.extract(image, nullptr).size() > 0, "an extractor goes on after bad input");
}

std::vector<Descriptor> random_descriptors(std::mt19937& random, int count) {
  std::vector<Descriptor> descriptors(static_cast<std::size_t>(count));
  for (Descriptor& descriptor : descriptors) {
    std::mt19937 kind(static_cast<unsigned>(random() % 300));
    for (std::uint8_t& byte : descriptor) {
      byte = static_cast<std::uint8_t>(kind() % 100 + random() % 9);
    }
  }
  return descriptors;
}

// A copy for the engine on the host.
struct Words {
  std::vector<unsigned> words;
  DescriptorsView view;

  explicit Words(const std::vector<Descriptor>& descriptors) : words(descriptors.size() * kWords) {
    std::memcpy(words.data(), descriptors.data(), words.size() * sizeof(unsigned));
    view = {words.data(), static_cast<int>(descriptors.size())};
  }
};

void test_matches(std::mt19937& random) {
  CudaMatcher device;
  MatcherEngine<OnHost> host;
  for (const auto& [queries, trains] :
       {std::pair{0, 0}, {0, 5}, {5, 0}, {1, 1}, {1, 1000}, {31, 33}, {65, 2}, {1000, 1001}}) {
    const std::vector<Descriptor> a = random_descriptors(random, queries);
    const std::vector<Descriptor> b = random_descriptors(random, trains);
    CudaFeatures query, train;
    query.assign(a);
    train.assign(b);
    for (const double ratio : {0.8, 1.0}) {
      for (const bool mutual : {false, true}) {
        const BruteForceOptions options{3.0, ratio, mutual};
        expect(device.match(query, train, options) ==
                   host.match(Words(a).view, Words(b).view, options),
               "matches are those of the host");
      }
    }
  }
}

struct HostStereo {
  Words left, right;
  std::vector<int> right_of_left;

  StereoView view() const { return {left.view, right.view, &right_of_left}; }
};

void test_circles(std::mt19937& random) {
  const std::vector<Descriptor> left = random_descriptors(random, 777);
  const std::vector<Descriptor> right = random_descriptors(random, 700);
  std::vector<int> right_of_left;
  for (int i = 0; i < 777; ++i) right_of_left.push_back(i < 700 && i % 5 != 0 ? i : -1);
  CudaStereoFeatures frame, empty;
  frame.left.assign(left);
  frame.right.assign(right);
  frame.right_of_left = right_of_left;
  const HostStereo on_host{Words(left), Words(right), right_of_left};
  CudaMatcher device;
  MatcherEngine<OnHost> host;
  const auto circles = device.match_circular(frame, frame, 0.9);
  const auto expected = host.match_circular(on_host.view(), on_host.view(), 0.9);
  expect(!circles.empty(), "there are circles");
  expect(circles.size() == expected.size(), "there are as many circles as on the host");
  for (std::size_t i = 0; i < std::min(circles.size(), expected.size()); ++i) {
    expect(circles[i].previous == expected[i].previous && circles[i].current == expected[i].current,
           "circles are those of the host");
  }
  expect(device.match_circular(frame, empty, 0.9).empty(), "no circles with nothing");
}

int run(bool quick) {
  if (const std::string why = why_no_cuda(); !why.empty()) {
    std::printf("%s\n", why.c_str());
    return 77;
  }
  std::mt19937 random(1);
  CudaSift reused(plain_options());
  const int trials = quick ? 4 : 24;
  for (int i = 0; i < trials; ++i) {
    const int largest = quick ? 200 : i < 20 ? 640 : 4096;
    test_features(make_trial(i, largest, random), reused);
  }
  test_nothing();
  test_bad_input();
  test_matches(random);
  test_circles(random);
  std::printf(failures == 0 ? "all passed\n" : "%d failures\n", failures);
  return failures == 0 ? 0 : 1;
}

}  // namespace
}  // namespace hybrid_slam::cuda

int main(int argc, char** argv) {
  const bool quick = argc == 2 && std::strcmp(argv[1], "--quick") == 0;
  if (argc > 1 && !quick) {
    std::fprintf(stderr, "usage: sift_cuda_test [--quick]\n");
    return 2;
  }
  try {
    return hybrid_slam::cuda::run(quick);
  } catch (const std::exception& error) {
    std::printf("FAILED: %s\n", error.what());
    return 1;
  }
}
