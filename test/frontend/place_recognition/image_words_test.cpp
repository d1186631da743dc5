#include "frontend/place_recognition/image_words.h"

#include <catch2/catch.hpp>

#include "frontend/place_recognition/inverted_index.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

TEST_CASE("Words are weighted by how often they occur and how rare they are") {
  const std::vector<NodeId> first_child{1, 5, 5, 5, 5, 5};
  const std::vector<float> weights{0, 2, 1, 0, 4};
  std::vector<Descriptor> bytes(5);
  for (std::size_t i = 1; i < 5; ++i) bytes[i].fill(static_cast<std::uint8_t>(50 * i));
  const Vocabulary vocabulary({DescriptorKind::kRootSift, 4, 1, first_child, weights, bytes, {}},
                              nullptr);
  std::vector<Descriptor> descriptors{bytes[4], bytes[1], bytes[3], bytes[1], bytes[2], bytes[1]};
  const ImageWords words = find_words(vocabulary, features_of(descriptors));
  // 1 three times, 2 once, 3 of no weight, 4 once: 6 + 1 + 4.
  REQUIRE(words.bow.size() == 3);
  CHECK(words.bow[0].word == 1);
  CHECK(words.bow[0].weight == Approx(6.0 / 11));
  CHECK(words.bow[1].word == 2);
  CHECK(words.bow[1].weight == Approx(1.0 / 11));
  CHECK(words.bow[2].word == 4);
  CHECK(words.bow[2].weight == Approx(4.0 / 11));
  const DirectIndex expected{{1, 1}, {1, 3}, {1, 5}, {2, 4}, {3, 2}, {4, 0}};
  CHECK(words.index == expected);
  CHECK(find_words(vocabulary, features_of({})).bow.empty());
  CHECK(find_words(vocabulary, features_of({bytes[3]})).bow.empty());
}

TEST_CASE("The score of two images is the share of what they have in common") {
  const BowVector a{{3, 0.5F}, {5, 0.25F}, {9, 0.25F}};
  const BowVector b{{4, 0.5F}, {5, 0.5F}};
  const BowVector c{{4, 1.0F}};
  CHECK(bow_score(a, a) == Approx(1));
  CHECK(bow_score(a, b) == Approx(0.25));
  CHECK(bow_score(b, a) == Approx(0.25));
  CHECK(bow_score(b, c) == Approx(0.5));
  CHECK(bow_score(a, c) == 0);
  CHECK(bow_score({}, a) == 0);
}

BowVector random_bow(NodeId nodes, Random& random) {
  std::vector<float> weights(nodes, 0);
  float sum = 0;
  for (int i = 0; i < 30; ++i) {
    const auto weight = static_cast<float>(random.uniform(0.1, 1));
    weights[1 + random.below(nodes - 1)] += weight;
    sum += weight;
  }
  BowVector bow;
  for (NodeId i = 0; i < nodes; ++i) {
    if (weights[i] > 0) bow.push_back({i, weights[i] / sum});
  }
  return bow;
}

int count_shared(const BowVector& a, const BowVector& b) {
  int shared = 0;
  for (const WordWeight& x : a) {
    shared += static_cast<int>(
        std::count_if(b.begin(), b.end(), [&](const WordWeight& y) { return x.word == y.word; }));
  }
  return shared;
}

TEST_CASE("The inverted index finds the keyframes that comparing all would find") {
  const Vocabulary vocabulary = small_vocabulary();
  const auto nodes = static_cast<NodeId>(vocabulary.tables().nodes());
  Random random(5);
  InvertedIndex index;
  std::map<KeyframeId, BowVector> keyframes;
  for (std::uint32_t i = 0; i < 200; ++i) {
    keyframes[KeyframeId(i)] = random_bow(nodes, random);
    index.add(KeyframeId(i), keyframes[KeyframeId(i)]);
  }
  for (std::uint32_t i = 0; i < 200; i += 3) {
    index.remove(KeyframeId(i));
    keyframes.erase(KeyframeId(i));
  }
  for (std::uint32_t i = 300; i < 330; ++i) {  // take freed places
    keyframes[KeyframeId(i)] = random_bow(nodes, random);
    index.add(KeyframeId(i), keyframes[KeyframeId(i)]);
  }
  CHECK(index.size() == keyframes.size());
  const std::vector<KeyframeId> excluded{KeyframeId(301), KeyframeId(4), KeyframeId(3)};
  for (int i = 0; i < 20; ++i) {
    const BowVector query = random_bow(nodes, random);
    std::size_t expected = 0;
    const auto hits = index.query(query, excluded);
    for (const auto& [id, bow] : keyframes) {
      const int shared = count_shared(query, bow);
      const auto hit = std::find_if(hits.begin(), hits.end(),
                                    [&](const SimilarKeyframe& h) { return h.keyframe == id; });
      const bool wanted = shared > 0 && id != excluded[0] && id != excluded[1];
      CHECK((hit != hits.end()) == wanted);
      expected += wanted ? 1 : 0;
      if (hit == hits.end()) continue;
      CHECK(hit->score == Approx(bow_score(query, bow)));
      CHECK(hit->shared_words == shared);
    }
    CHECK(hits.size() == expected);
    CHECK(std::is_sorted(hits.begin(), hits.end(), [](const auto& a, const auto& b) {
      return a.score > b.score || (a.score == b.score && a.keyframe < b.keyframe);
    }));
  }
}

TEST_CASE("Keyframes of equal score come by their ids; each is added once") {
  const Vocabulary vocabulary = small_vocabulary();
  InvertedIndex index;
  const BowVector bow{{30, 1.0F}};
  for (const std::uint32_t id : {7U, 2U, 5U}) index.add(KeyframeId(id), bow);
  const auto hits = index.query(bow, {});
  REQUIRE(hits.size() == 3);
  CHECK(hits[0].keyframe == KeyframeId(2));
  CHECK(hits[1].keyframe == KeyframeId(5));
  CHECK(hits[2].keyframe == KeyframeId(7));
  CHECK_THROWS_AS(index.add(KeyframeId(5), bow), std::logic_error);
  index.remove(KeyframeId(99));
  index.remove(KeyframeId(5));
  index.add(KeyframeId(5), bow);
  CHECK(index.size() == 3);
  CHECK(index.query({}, {}).empty());
}

}  // namespace
}  // namespace hybrid_slam
