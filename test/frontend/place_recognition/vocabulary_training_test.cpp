#include "frontend/place_recognition/vocabulary_training.h"

#include <cmath>
#include <set>

#include <catch2/catch.hpp>

#include "test/frontend/place_recognition/sample_vocabulary.h"

namespace hybrid_slam {
namespace {

Vocabulary train(std::vector<Descriptor> descriptors, const VocabularyTrainingOptions& options,
                 const ParallelFor& parallel = serial_for) {
  return train_vocabulary(descriptors, DescriptorKind::kRootSift, options, parallel, no_progress);
}

TEST_CASE("A trained tree has the shape that was asked for, and no word is unused") {
  const auto descriptors = random_descriptors(20000, 3000, 2);
  const Vocabulary vocabulary = train(descriptors, {.branching = 5, .levels = 4});
  CHECK(vocabulary.words() > 550);
  CHECK(vocabulary.words() <= 625);
  CHECK(vocabulary.depth() == 4);
  std::set<NodeId> words;
  for (const auto& place : vocabulary.find(DescriptorKind::kRootSift, descriptors)) {
    words.insert(place.word);
  }
  CHECK(words.size() == vocabulary.words());
}

TEST_CASE("Training repeats itself, whatever the order of the work") {
  // Enough for a root that all threads work on.
  const auto descriptors = random_descriptors(80000, 500, 3);
  const VocabularyTrainingOptions options{.branching = 6, .levels = 3, .max_iterations = 5};
  const Vocabulary a = train(descriptors, options);
  const Vocabulary b = train(descriptors, options, backward_for);
  CHECK(same_tables(a, b));
  VocabularyTrainingOptions other = options;
  other.seed = 1;
  CHECK_FALSE(same_tables(a, train(descriptors, other)));
}

TEST_CASE("Descriptors that differ become words of their own") {
  const auto descriptors = random_descriptors(9, 1000, 4);
  std::vector<Descriptor> thrice;
  for (int i = 0; i < 3; ++i) thrice.insert(thrice.end(), descriptors.begin(), descriptors.end());
  const Vocabulary vocabulary = train(thrice, {.branching = 3, .levels = 6});
  CHECK(vocabulary.words() == 9);
  for (const auto& place : vocabulary.find(DescriptorKind::kRootSift, descriptors)) {
    const Descriptor& mean = vocabulary.tables().bytes[place.word];
    CHECK(std::find(descriptors.begin(), descriptors.end(), mean) != descriptors.end());
  }
}

TEST_CASE("A word weighs the logarithm of how few images have it") {
  auto descriptors = random_descriptors(40, 1000, 5);
  const Vocabulary tree = train(descriptors, {.branching = 20, .levels = 2});
  REQUIRE(tree.words() == 40);
  // Images: 0 1 2 | 0 0 3 | 0 1 | nothing.
  const std::vector<int> order{0, 1, 2, 0, 0, 3, 0, 1};
  std::vector<Descriptor> images;
  for (const int i : order) images.push_back(descriptors[static_cast<std::size_t>(i)]);
  const std::vector<std::uint64_t> ends{3, 6, 8, 8};
  for (const ParallelFor& parallel : {ParallelFor(serial_for), ParallelFor(backward_for)}) {
    const Vocabulary weighed = weigh_words(tree, images, ends, parallel, no_progress);
    const auto places = weighed.find(DescriptorKind::kRootSift, descriptors);
    const double expected[] = {std::log(4.0 / 3), std::log(4.0 / 2), std::log(4.0), std::log(4.0)};
    for (std::size_t i = 0; i < 40; ++i) {
      CHECK(weighed.tables().weights[places[i].word] == Approx(i < 4 ? expected[i] : 0));
    }
  }
}

TEST_CASE("Training tells how far it is") {
  std::string last;
  std::size_t done = 0, total = 0;
  std::vector<Descriptor> descriptors = random_descriptors(3000, 300, 6);
  train_vocabulary(descriptors, DescriptorKind::kRootSift, {.levels = 2}, serial_for,
                   [&](const std::string& unit, std::size_t now, std::size_t of) {
                     if (unit == last) CHECK(now >= done);
                     CHECK(now <= of);
                     last = unit;
                     done = now;
                     total = of;
                   });
  CHECK(last == "nodes split at level 1 of 2");
  CHECK(done == 10);
  CHECK(total == 10);
}

TEST_CASE("Training refuses what cannot be trained") {
  const auto descriptors = random_descriptors(10, 10, 7);
  CHECK_THROWS_AS(train(descriptors, {.branching = 1}), std::invalid_argument);
  CHECK_THROWS_AS(train(descriptors, {.branching = 21}), std::invalid_argument);
  CHECK_THROWS_AS(train(descriptors, {.levels = 0}), std::invalid_argument);
  CHECK_THROWS_AS(train(descriptors, {.levels = 11}), std::invalid_argument);
  CHECK_THROWS_AS(train(descriptors, {.max_iterations = 0}), std::invalid_argument);
  CHECK_THROWS_AS(train({}, {}), std::invalid_argument);
  CHECK_THROWS_AS(train({5, descriptors[0]}, {}), std::invalid_argument);
}

}  // namespace
}  // namespace hybrid_slam
