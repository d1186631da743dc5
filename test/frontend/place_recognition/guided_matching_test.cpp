#include "frontend/place_recognition/guided_matching.h"

#include <catch2/catch.hpp>

#include "frontend/matching/descriptor_distance.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

struct Pair {
  Vocabulary vocabulary = small_vocabulary();
  FeatureSet query, train;
  DirectIndex query_index, train_index;
};

// The second image shows most of what the first does, changed a little, and more.
Pair similar_images() {
  Pair pair;
  Random random(8);
  std::vector<Descriptor> query = random_descriptors(400, 200, 9);
  std::vector<Descriptor> train = random_descriptors(150, 200, 10);
  for (std::size_t i = 0; i < 300; ++i) {
    train.push_back(query[i]);
    for (std::uint8_t& byte : train.back()) {
      byte = static_cast<std::uint8_t>(std::max(0, byte + random.integer(-3, 3)));
    }
  }
  pair.query = features_of(query);
  pair.train = features_of(train);
  pair.query_index = find_words(pair.vocabulary, pair.query).index;
  pair.train_index = find_words(pair.vocabulary, pair.train).index;
  return pair;
}

// Brute force over the pairs below the same node.
std::vector<DescriptorMatch> reference(const Pair& pair, const BruteForceOptions& options) {
  const auto guide = [](const DirectIndex& index, std::size_t count) {
    std::vector<int> guides(count, -1);
    for (const NodeFeature& entry : index) {
      guides[static_cast<std::size_t>(entry.feature)] = static_cast<int>(entry.node);
    }
    return guides;
  };
  const auto q_guide = guide(pair.query_index, pair.query.size());
  const auto t_guide = guide(pair.train_index, pair.train.size());
  std::vector<DescriptorMatch> matches;
  for (std::size_t q = 0; q < q_guide.size(); ++q) {
    int best = -1, best_distance = 0, second = -1;
    for (std::size_t t = 0; t < t_guide.size(); ++t) {
      if (q_guide[q] < 0 || q_guide[q] != t_guide[t]) continue;
      const int distance = squared_distance(pair.query.descriptors[q], pair.train.descriptors[t]);
      if (best < 0 || distance < best_distance) {
        second = best < 0 ? -1 : best_distance;
        best = static_cast<int>(t);
        best_distance = distance;
      } else if (second < 0 || distance < second) {
        second = distance;
      }
    }
    if (best < 0 || best_distance > to_squared_bytes(options.max_descriptor_distance)) continue;
    if (options.ratio < 1 && !passes_ratio(best_distance, second, options.ratio)) continue;
    bool mutual = true;
    for (std::size_t other = 0; other < q_guide.size() && options.mutual; ++other) {
      if (q_guide[other] != q_guide[q] || other == q) continue;
      const int distance = squared_distance(pair.query.descriptors[other],
                                            pair.train.descriptors[static_cast<std::size_t>(best)]);
      mutual &= other < q ? distance > best_distance : distance >= best_distance;
    }
    if (mutual) matches.push_back({static_cast<int>(q), best, best_distance});
  }
  return matches;
}

TEST_CASE("Guided matching is brute force below the same node") {
  const Pair pair = similar_images();
  for (const BruteForceOptions& options :
       {BruteForceOptions{}, BruteForceOptions{.ratio = 0.8},
        BruteForceOptions{.max_descriptor_distance = 0.1, .mutual = false},
        BruteForceOptions{.ratio = 0.6, .mutual = false}}) {
    const auto matches =
        match_guided(pair.query, pair.query_index, pair.train, pair.train_index, options);
    CHECK(matches.size() > 100);
    CHECK(matches == reference(pair, options));
  }
}

TEST_CASE("Guided matching finds nearly all that is to be found") {
  const Pair pair = similar_images();
  int right = 0;
  const auto matches = match_guided(pair.query, pair.query_index, pair.train, pair.train_index,
                                    {.max_descriptor_distance = 0.2, .ratio = 0.8});
  for (const DescriptorMatch& match : matches) right += match.train == match.query + 150;
  CHECK(right > 270);  // of 300
  CHECK(static_cast<double>(right) > 0.98 * static_cast<double>(matches.size()));
}

TEST_CASE("Features that an index lacks take no part in guided matching") {
  Pair pair = similar_images();
  std::erase_if(pair.query_index, [](const NodeFeature& entry) { return entry.feature % 2 == 0; });
  std::erase_if(pair.train_index, [](const NodeFeature& entry) { return entry.feature % 3 == 0; });
  const BruteForceOptions options{.ratio = 0.9};
  const auto matches =
      match_guided(pair.query, pair.query_index, pair.train, pair.train_index, options);
  CHECK(matches.size() > 50);
  CHECK(matches == reference(pair, options));
  CHECK(match_guided(pair.query, {}, pair.train, pair.train_index, options).empty());
}

TEST_CASE("Guided matching refuses descriptors of different kinds") {
  Pair pair = similar_images();
  pair.train.kind = DescriptorKind::kRootSiftOpenCv;
  CHECK_THROWS_AS(match_guided(pair.query, pair.query_index, pair.train, pair.train_index, {}),
                  std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
