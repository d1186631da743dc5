#include "frontend/matching/brute_force.h"

#include <cmath>
#include <stdexcept>

#include <hwy/targets.h>
#include <catch2/catch.hpp>

#include "frontend/matching/descriptor_distance.h"
#include "test/frontend/matching/random_descriptors.h"

namespace hybrid_slam {
namespace {

// Runs a check once for every instruction set that this machine and the program have.
template <typename Check>
void on_every_target(const Check& check) {
  for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    INFO("instruction set " << hwy::TargetName(target));
    check();
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().DeInit();
}

double naive_distance(const Descriptor& a, const Descriptor& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double difference = static_cast<double>(a[i]) - static_cast<double>(b[i]);
    sum += difference * difference;
  }
  return sum;
}

struct NaiveNearest {
  int best = -1;
  double distance = -1;
  double second = -1;
};

NaiveNearest naive_nearest(const Descriptor& query, const std::vector<Descriptor>& train) {
  NaiveNearest result;
  for (std::size_t j = 0; j < train.size(); ++j) {
    const double d = naive_distance(query, train[j]);
    if (result.best < 0 || d < result.distance) {
      result.second = result.distance;
      result.best = static_cast<int>(j);
      result.distance = d;
    } else if (result.second < 0 || d < result.second) {
      result.second = d;
    }
  }
  return result;
}

FeatureSet random_features(std::mt19937_64& random, std::size_t count, unsigned max_byte = 255) {
  FeatureSet features;
  features.kind = DescriptorKind::kSynthetic;
  features.keypoints.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    features.descriptors.push_back(random_descriptor(random, max_byte));
  }
  return features;
}

Descriptor with_first(std::uint8_t value) {
  Descriptor descriptor{};
  descriptor[0] = value;
  return descriptor;
}

FeatureSet features_of(std::vector<Descriptor> descriptors) {
  FeatureSet features;
  features.kind = DescriptorKind::kSynthetic;
  features.keypoints.resize(descriptors.size());
  features.descriptors = std::move(descriptors);
  return features;
}

TEST_CASE("Descriptor distances are exact") {
  std::mt19937_64 random(1);
  Descriptor zeros{};
  Descriptor full;
  full.fill(255);
  on_every_target([&] {
    CHECK(squared_distance(zeros, full) == 128 * 255 * 255);
    CHECK(squared_distance(full, full) == 0);
    for (int k = 0; k < 100; ++k) {
      const Descriptor a = random_descriptor(random);
      const Descriptor b = random_descriptor(random);
      CHECK(squared_distance(a, b) == naive_distance(a, b));
    }
    const FeatureSet set = random_features(random, 20);
    const std::vector<int> candidates = {19, 0, 7, 7};
    std::vector<std::int32_t> distances(4);
    squared_distances(full, set.descriptors, candidates, distances);
    for (std::size_t k = 0; k < 4; ++k) {
      const auto c = static_cast<std::size_t>(candidates[k]);
      CHECK(distances[k] == naive_distance(full, set.descriptors[c]));
    }
    squared_distances(full, set.descriptors, {}, {});
  });
}

TEST_CASE("Distances between unit descriptors and bytes convert both ways") {
  CHECK(to_squared_bytes(1.0) == 512 * 512);
  CHECK(to_squared_bytes(-1.0) == 0);
  CHECK(to_squared_bytes(1e9) == 2147483647);
  CHECK(from_squared_bytes(to_squared_bytes(0.75)) == Approx(0.75));
}

TEST_CASE("The nearest neighbours equal those of a naive search") {
  std::mt19937_64 random(2);
  const std::size_t sizes[] = {0, 1, 2, 3, 4, 5, 8, 31, 33, 64, 129, 300};
  on_every_target([&] {
    for (const std::size_t queries : sizes) {
      for (const std::size_t trains : sizes) {
        // Few values: many equal distances.
        const unsigned max_byte = (queries + trains) % 2 ? 255 : 1;
        const FeatureSet query = random_features(random, queries, max_byte);
        const FeatureSet train = random_features(random, trains, max_byte);
        const NearestNeighbours found = find_nearest(query.descriptors, train.descriptors);
        REQUIRE(found.best.size() == queries);
        REQUIRE(found.best_query.size() == trains);
        bool equal = true;
        for (std::size_t i = 0; i < queries; ++i) {
          const NaiveNearest expected = naive_nearest(query.descriptors[i], train.descriptors);
          equal = equal && found.best[i] == expected.best &&
                  found.best_distance[i] == expected.distance &&
                  found.second_distance[i] == expected.second;
        }
        for (std::size_t j = 0; j < trains; ++j) {
          const NaiveNearest expected = naive_nearest(train.descriptors[j], query.descriptors);
          equal = equal && found.best_query[j] == expected.best;
        }
        INFO(queries << " x " << trains);
        CHECK(equal);
      }
    }
  });
}

TEST_CASE("The largest distances do not overflow") {
  Descriptor zeros{};
  Descriptor full;
  full.fill(255);
  on_every_target([&] {
    const std::vector<Descriptor> query = {zeros};
    const std::vector<Descriptor> train = {full};
    const NearestNeighbours found = find_nearest(query, train);
    CHECK(found.best[0] == 0);
    CHECK(found.best_distance[0] == 128 * 255 * 255);
    CHECK(found.second_distance[0] == -1);
    CHECK(found.best_query[0] == 0);
  });
}

TEST_CASE("Equal distances go to the lower index") {
  const std::vector<Descriptor> query(40, with_first(9));
  const std::vector<Descriptor> train(70, with_first(5));
  on_every_target([&] {
    const NearestNeighbours found = find_nearest(query, train);
    for (const int best : found.best) CHECK(best == 0);
    for (const int best : found.best_query) CHECK(best == 0);
    for (const std::int32_t second : found.second_distance) CHECK(second == 16);
  });
}

TEST_CASE("Brute-force matching applies distance, ratio and mutual choice") {
  const FeatureSet query = features_of({with_first(10), with_first(100), with_first(12)});
  const FeatureSet train = features_of({with_first(90), with_first(11), with_first(200)});
  BruteForceOptions options;
  options.mutual = false;
  using Matches = std::vector<DescriptorMatch>;
  CHECK(match_brute_force(query, train, options) == Matches{{0, 1, 1}, {1, 0, 100}, {2, 1, 1}});
  options.mutual = true;
  CHECK(match_brute_force(query, train, options) == Matches{{0, 1, 1}, {1, 0, 100}});
  options.ratio = 10.0 / 89.0 - 1e-6;  // of query 1: best 10, second 89
  CHECK(match_brute_force(query, train, options) == Matches{{0, 1, 1}});
  options.ratio = 10.0 / 89.0 + 1e-6;
  CHECK(match_brute_force(query, train, options) == Matches{{0, 1, 1}, {1, 0, 100}});
  options.ratio = 1;
  options.max_descriptor_distance = 9.9 / 512;
  CHECK(match_brute_force(query, train, options) == Matches{{0, 1, 1}});
  options.max_descriptor_distance = 10.0 / 512;
  CHECK(match_brute_force(query, train, options) == Matches{{0, 1, 1}, {1, 0, 100}});
}

TEST_CASE("Brute-force matching of few or none") {
  const FeatureSet none = features_of({});
  const FeatureSet one = features_of({with_first(3)});
  const BruteForceOptions options{.max_descriptor_distance = 0.9, .ratio = 0.5, .mutual = true};
  CHECK(match_brute_force(none, one, options).empty());
  CHECK(match_brute_force(one, none, options).empty());
  CHECK(match_brute_force(none, none, options).empty());
  CHECK(match_brute_force(one, one, options) == std::vector<DescriptorMatch>{{0, 0, 0}});
}

TEST_CASE("Descriptors of different kinds are not compared") {
  const FeatureSet synthetic = features_of({with_first(3)});
  FeatureSet other = synthetic;
  other.kind = DescriptorKind::kRootSiftOpenCv;
  CHECK_THROWS_AS(match_brute_force(synthetic, other, {}), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
