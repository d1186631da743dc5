#include "frontend/place_recognition/image_words.h"

#include <algorithm>

namespace hybrid_slam {
namespace {

BowVector make_bow(const Vocabulary& vocabulary, const std::vector<Vocabulary::Place>& places) {
  std::vector<NodeId> words;
  words.reserve(places.size());
  for (const Vocabulary::Place& place : places) words.push_back(place.word);
  std::sort(words.begin(), words.end());
  BowVector bow;
  double sum = 0;
  for (const NodeId word : words) {
    const float weight = vocabulary.tables().weights[word];
    if (!(weight > 0)) continue;
    if (bow.empty() || bow.back().word != word) bow.push_back({word, 0});
    bow.back().weight += weight;
    sum += weight;
  }
  for (WordWeight& entry : bow) entry.weight = static_cast<float>(entry.weight / sum);
  return bow;
}

void sort(DirectIndex& index) {
  std::sort(index.begin(), index.end(), [](const NodeFeature& a, const NodeFeature& b) {
    return a.node != b.node ? a.node < b.node : a.feature < b.feature;
  });
}

}  // namespace

ImageWords find_words(const Vocabulary& vocabulary, const FeatureSet& features) {
  const auto places = vocabulary.find(features.kind, features.descriptors);
  ImageWords words{make_bow(vocabulary, places), {}};
  words.index.reserve(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    words.index.push_back({places[i].guide, static_cast<int>(i)});
  }
  sort(words.index);
  return words;
}

DirectIndex find_index(const Vocabulary& vocabulary, const FeatureSet& features,
                       std::span<const int> some) {
  std::vector<Descriptor> descriptors;
  descriptors.reserve(some.size());
  for (const int i : some) descriptors.push_back(features.descriptors[static_cast<std::size_t>(i)]);
  const auto places = vocabulary.find(features.kind, descriptors);
  DirectIndex index;
  index.reserve(some.size());
  for (std::size_t i = 0; i < some.size(); ++i) index.push_back({places[i].guide, some[i]});
  sort(index);
  return index;
}

double bow_score(const BowVector& a, const BowVector& b) {
  double score = 0;
  auto i = a.begin();
  auto j = b.begin();
  while (i != a.end() && j != b.end()) {
    if (i->word < j->word) {
      ++i;
    } else if (j->word < i->word) {
      ++j;
    } else {
      score += std::min(i->weight, j->weight);
      ++i;
      ++j;
    }
  }
  return score;
}

}  // namespace hybrid_slam
