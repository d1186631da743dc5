// The kernels of the CUDA matchers, run on the host, must give what the CPU's matchers give.
#include <algorithm>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>
#include "frontend/features/cuda/on_host.h"
#include "frontend/matching/circular_matcher.h"
#include "frontend/matching/cuda/matcher_engine.h"

namespace hybrid_slam::cuda {
namespace {

// Few different ones, noisy by so much: ties and near ties are common.
FeatureSet random_set(std::mt19937& random, int count, unsigned kinds, unsigned noise) {
  FeatureSet set;
  set.kind = DescriptorKind::kSynthetic;
  for (int i = 0; i < count; ++i) {
    std::mt19937 of_kind(static_cast<unsigned>(random() % kinds));
    Descriptor descriptor;
    for (std::uint8_t& byte : descriptor) {
      byte = static_cast<std::uint8_t>((of_kind() % 2 ? 255 : 90) * (of_kind() % 9 == 0) +
                                       random() % noise);
    }
    set.descriptors.push_back(descriptor);
    set.keypoints.emplace_back();
  }
  return set;
}

// Words of descriptors.
struct Words {
  std::vector<unsigned> words;
  DescriptorsView view;

  explicit Words(const FeatureSet& set) : words(set.size() * kWords) {
    std::memcpy(words.data(), set.descriptors.data(), words.size() * sizeof(unsigned));
    view = {words.data(), static_cast<int>(set.size())};
  }
};

constexpr std::pair<int, int> kSizes[] = {
    {0, 0},   {0, 5},   {5, 0},    {0, 1000}, {1, 1},     {1, 2},     {2, 1},      {31, 33},
    {33, 31}, {31, 31}, {33, 33},  {63, 65},  {64, 64},   {65, 1},    {1, 130},    {128, 3},
    {1, 33},  {31, 1},  {1000, 0}, {1, 1000}, {33, 1000}, {1000, 31}, {1000, 1000}};

TEST_CASE("CUDA's matches are those of the CPU") {
  std::mt19937 random(1);
  std::size_t total = 0;
  for (const bool backward : {false, true}) {
    MatcherEngine<OnHost> engine(backward);
    for (const auto& [queries, trains] : kSizes) {
      for (const unsigned kinds : {5U, 100000U}) {
        const FeatureSet query = random_set(random, queries, kinds, 4);
        const FeatureSet train = random_set(random, trains, kinds, 4);
        for (const double ratio : {0.8, 0.99, 1.0}) {
          for (const bool mutual : {false, true}) {
            const BruteForceOptions options{
                .max_descriptor_distance = mutual ? 0.9 : 3.0, .ratio = ratio, .mutual = mutual};
            INFO(queries << " x " << trains << ", ratio " << ratio << ", mutual " << mutual);
            const auto expected = match_brute_force(query, train, options);
            CHECK(engine.match(Words(query).view, Words(train).view, options) == expected);
            total += expected.size();
          }
        }
      }
    }
  }
  CHECK(total > 1000);
}

StereoFeatures random_stereo(std::mt19937& random, int lefts, int rights) {
  StereoFeatures stereo;
  stereo.left = random_set(random, lefts, 40, 4);
  stereo.right = random_set(random, rights, 40, 4);
  std::vector<int> order(static_cast<std::size_t>(std::max(lefts, rights)));
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  std::shuffle(order.begin(), order.end(), random);
  for (int i = 0; i < lefts; ++i) {
    const int right = order[static_cast<std::size_t>(i)];
    stereo.right_of_left.push_back(right < rights && random() % 4 ? right : -1);
  }
  return stereo;
}

TEST_CASE("CUDA's circles are those of the CPU") {
  std::mt19937 random(2);
  std::size_t total = 0;
  for (const bool backward : {false, true}) {
    MatcherEngine<OnHost> engine(backward);
    for (const auto& [of_previous, of_current] : kSizes) {
      const StereoFeatures previous = random_stereo(random, of_previous, of_current);
      StereoFeatures current = random_stereo(random, of_current, of_previous);
      // Some true circles.
      for (std::size_t i = 0; i < previous.left.size() && i < current.left.size(); ++i) {
        if (previous.right_of_left[i] < 0 || current.right_of_left[i] < 0 || i % 3 == 0) continue;
        current.left.descriptors[i] = previous.left.descriptors[i];
        current.right.descriptors[static_cast<std::size_t>(current.right_of_left[i])] =
            previous.right.descriptors[static_cast<std::size_t>(previous.right_of_left[i])];
      }
      INFO(of_previous << " and " << of_current);
      const CircularMatcherOptions options{.max_descriptor_distance = 0.5};
      const auto expected = match_circular(previous, current, options);
      const Words words[] = {Words(previous.left), Words(previous.right), Words(current.left),
                             Words(current.right)};
      const auto circles = engine.match_circular(
          {words[0].view, words[1].view, &previous.right_of_left},
          {words[2].view, words[3].view, &current.right_of_left}, options.max_descriptor_distance);
      REQUIRE(circles.size() == expected.size());
      for (std::size_t i = 0; i < circles.size(); ++i) {
        CHECK(circles[i].previous == expected[i].previous);
        CHECK(circles[i].current == expected[i].current);
      }
      total += circles.size();
    }
  }
  CHECK(total > 50);
}

}  // namespace
}  // namespace hybrid_slam::cuda
