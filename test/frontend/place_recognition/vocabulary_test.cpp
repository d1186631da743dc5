#include "frontend/place_recognition/vocabulary.h"

#include <catch2/catch.hpp>

#include "frontend/matching/descriptor_distance.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"

namespace hybrid_slam {
namespace {

// From the root down, as plainly as can be. One node per level.
std::vector<NodeId> path_of(const VocabularyTables& tables, const Descriptor& descriptor) {
  std::vector<NodeId> path{0};
  while (tables.first_child[path.back()] < tables.first_child[path.back() + 1]) {
    const NodeId end = tables.first_child[path.back() + 1];
    NodeId best = tables.first_child[path.back()];
    for (NodeId node = best; node < end; ++node) {
      if (squared_distance(descriptor, tables.bytes[node]) <
          squared_distance(descriptor, tables.bytes[best])) {
        best = node;
      }
    }
    path.push_back(best);
  }
  return path;
}

TEST_CASE("A descriptor's word is reached by the nearest child, level by level") {
  const Vocabulary vocabulary = small_vocabulary();
  const auto descriptors = random_descriptors(500, 80, 77);
  const auto places = vocabulary.find(DescriptorKind::kRootSift, descriptors);
  REQUIRE(places.size() == descriptors.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto path = path_of(vocabulary.tables(), descriptors[i]);
    CHECK(places[i].word == path.back());
    const auto level = static_cast<std::size_t>(vocabulary.guide_level());
    CHECK(places[i].guide == path[std::min(level, path.size() - 1)]);
  }
}

TEST_CASE("Of children that are equally near the first one counts") {
  const std::vector<NodeId> first_child{1, 3, 3, 3};
  const std::vector<float> weights{0, 1, 1};
  std::vector<Descriptor> bytes(3);
  bytes[1].fill(10);
  bytes[2].fill(20);
  const Vocabulary vocabulary({DescriptorKind::kRootSift, 2, 1, first_child, weights, bytes, {}},
                              nullptr);
  std::vector<Descriptor> query(2);
  query[0].fill(15);
  query[1].fill(16);
  const auto places = vocabulary.find(DescriptorKind::kRootSift, query);
  CHECK(places[0].word == 1);
  CHECK(places[1].word == 2);
}

TEST_CASE("A vocabulary in floats finds the same words") {
  const Vocabulary vocabulary = small_vocabulary();
  const Vocabulary floats = in_floats(vocabulary);
  const auto descriptors = random_descriptors(500, 80, 78);
  CHECK(floats.find(DescriptorKind::kPlainSift, descriptors) ==
        vocabulary.find(DescriptorKind::kRootSift, descriptors));
}

TEST_CASE("A vocabulary refuses descriptors of another kind") {
  const Vocabulary vocabulary = small_vocabulary();
  const auto descriptors = random_descriptors(1, 1, 1);
  CHECK_THROWS_AS(vocabulary.find(DescriptorKind::kRootSiftOpenCv, descriptors), std::logic_error);
  CHECK_THROWS_AS(in_floats(vocabulary).find(DescriptorKind::kRootSift, descriptors),
                  std::logic_error);
}

TEST_CASE("A vocabulary knows its words, levels and guides") {
  const Vocabulary deep = small_vocabulary(4, 5);
  CHECK(deep.level_begin(0) == 0);
  CHECK(deep.level_begin(1) == 1);
  CHECK(deep.level_begin(2) == 5);
  CHECK(deep.level_begin(3) == 21);
  CHECK(deep.level_begin(4) > 80);
  CHECK(deep.level_begin(4) <= 85);
  CHECK(deep.depth() == 5);
  CHECK(deep.level_begin(6) == deep.tables().nodes());
  CHECK(deep.guide_level() == 3);  // 64 nodes; 256 below are too many
  CHECK(small_vocabulary(10, 2).guide_level() == 2);
  CHECK(small_vocabulary(10, 1).guide_level() == 1);
  std::size_t words = 0;
  for (std::size_t i = 0; i < deep.tables().nodes(); ++i) {
    words += deep.tables().first_child[i] == deep.tables().first_child[i + 1];
  }
  CHECK(deep.words() == words);
}

TEST_CASE("Tables that are no tree are refused") {
  const Vocabulary good = small_vocabulary();
  const auto refused = [&](const auto& change) {
    VocabularyTables tables = good.tables();
    std::vector<NodeId> first_child(tables.first_child.begin(), tables.first_child.end());
    std::vector<float> weights(tables.weights.begin(), tables.weights.end());
    tables.first_child = first_child;
    tables.weights = weights;
    change(tables, first_child, weights);
    CHECK_THROWS_AS(Vocabulary(tables, nullptr), std::logic_error);
    return !tables.validate().empty();
  };
  using Ids = std::vector<NodeId>;
  using Weights = std::vector<float>;
  CHECK(good.tables().validate().empty());
  CHECK(refused([](auto& t, Ids&, Weights&) { t.branching = 3; }));
  CHECK(refused([](auto& t, Ids&, Weights&) { t.branching = 21; }));
  CHECK(refused([](auto& t, Ids&, Weights&) { t.levels = 2; }));
  CHECK(refused([](auto& t, Ids&, Weights&) { t.levels = 11; }));
  CHECK(refused([](auto& t, Ids&, Weights&) { t.bytes = t.bytes.first(5); }));
  CHECK(refused([](auto& t, Ids&, Weights&) { t.bytes = {}; }));
  CHECK(refused([](auto& t, Ids&, Weights&) { t.weights = t.weights.first(0); }));
  CHECK(refused([](auto& t, Ids& ids, Weights&) { t.first_child = std::span(ids).first(9); }));
  CHECK(refused([](auto&, Ids& ids, Weights&) { ids[0] = 0; }));
  CHECK(refused([](auto&, Ids& ids, Weights&) { ids.back() += 1; }));
  CHECK(refused([](auto&, Ids& ids, Weights&) { ids[2] = 4000000000; }));
  CHECK(refused([](auto&, Ids& ids, Weights&) { std::swap(ids[2], ids[3]); }));
  CHECK(refused([](auto&, Ids& ids, Weights&) { ids[1] = 1; }));  // a child of itself
  CHECK(refused([](auto&, Ids&, Weights& w) { w[7] = -1; }));
  CHECK(refused([](auto&, Ids&, Weights& w) { w[7] = std::nanf(""); }));
}

}  // namespace
}  // namespace hybrid_slam
