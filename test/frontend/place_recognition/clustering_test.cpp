#include "frontend/place_recognition/clustering.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "frontend/matching/descriptor_distance.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

Descriptor rounded_mean(std::span<const Descriptor> descriptors) {
  Descriptor mean;
  for (std::size_t k = 0; k < mean.size(); ++k) {
    double sum = 0;
    for (const Descriptor& d : descriptors) sum += d[k];
    mean[k] = static_cast<std::uint8_t>(sum / static_cast<double>(descriptors.size()) + 0.5);
  }
  return mean;
}

TEST_CASE("Clustering finds groups that lie apart") {
  const std::vector<Descriptor> centers = random_descriptors(6, 1000, 3);
  std::vector<Descriptor> descriptors;
  Random random(3);
  for (std::size_t i = 0; i < 600; ++i) {
    descriptors.push_back(centers[i % 6]);
    for (std::uint8_t& byte : descriptors.back()) {
      byte = static_cast<std::uint8_t>(std::max(0, byte + random.integer(-2, 2)));
    }
  }
  const std::vector<Descriptor> before = descriptors;
  const auto clusters = cluster_descriptors(descriptors, {.clusters = 6}, serial_for);
  REQUIRE(clusters.size() == 6);
  std::size_t begin = 0;
  for (const Cluster& cluster : clusters) {
    const std::span members(descriptors.data() + begin, cluster.count);
    CHECK(cluster.mean == rounded_mean(members));
    CHECK(cluster.count == 100);
    for (const Descriptor& d : members) CHECK(squared_distance(d, members[0]) < 100 * 100);
    begin += cluster.count;
  }
  CHECK(begin == descriptors.size());
  CHECK(std::is_permutation(before.begin(), before.end(), descriptors.begin()));
}

TEST_CASE("Clusters hold what is nearest to their mean") {
  std::vector<Descriptor> descriptors = random_descriptors(2000, 50, 4);
  const auto clusters = cluster_descriptors(descriptors, {.clusters = 7}, serial_for);
  REQUIRE(clusters.size() == 7);
  std::size_t at = 0;
  for (std::size_t c = 0; c < clusters.size(); ++c) {
    for (std::size_t i = 0; i < clusters[c].count; ++i, ++at) {
      const std::int32_t own = squared_distance(descriptors[at], clusters[c].mean);
      for (std::size_t other = 0; other < clusters.size(); ++other) {
        const std::int32_t distance = squared_distance(descriptors[at], clusters[other].mean);
        CHECK((other < c ? own < distance : own <= distance));
      }
    }
  }
}

TEST_CASE("Clustering does not depend on the order of the work, but on the seed") {
  const std::vector<Descriptor> descriptors = random_descriptors(30000, 80, 5);
  auto forward = descriptors, backward = descriptors, seeded = descriptors;
  const auto a = cluster_descriptors(forward, {}, serial_for);
  const auto b = cluster_descriptors(backward, {}, backward_for);
  const auto c = cluster_descriptors(seeded, {.seed = 9}, serial_for);
  REQUIRE(a.size() == b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    CHECK(a[i].mean == b[i].mean);
    CHECK(a[i].count == b[i].count);
  }
  CHECK(forward == backward);
  CHECK(seeded != forward);
}

TEST_CASE("There are no more clusters than different descriptors") {
  CHECK(cluster_descriptors({}, {}, serial_for).empty());
  std::vector<Descriptor> few = random_descriptors(3, 100, 6);
  for (int i = 0; i < 20; ++i) few.push_back(few[static_cast<std::size_t>(i) % 3]);
  auto clusters = cluster_descriptors(few, {}, serial_for);
  REQUIRE(clusters.size() == 3);
  for (const Cluster& cluster : clusters) CHECK(cluster.count >= 7);
  std::vector<Descriptor> equal(50, few[0]);
  clusters = cluster_descriptors(equal, {}, serial_for);
  REQUIRE(clusters.size() == 1);
  CHECK(clusters[0].count == 50);
  CHECK(clusters[0].mean == few[0]);
}

}  // namespace
}  // namespace hybrid_slam
