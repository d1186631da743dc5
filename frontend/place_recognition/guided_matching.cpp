#include "frontend/place_recognition/guided_matching.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "frontend/matching/descriptor_distance.h"

namespace hybrid_slam {
namespace {

using Features = std::vector<int>;

// The features of the node at `at`, which moves on to the next node.
Features take_node(const DirectIndex& index, std::size_t& at) {
  Features features;
  const NodeId node = index[at].node;
  for (; at < index.size() && index[at].node == node; ++at) features.push_back(index[at].feature);
  return features;
}

struct Best {
  int index = -1;
  std::int32_t distance = std::numeric_limits<std::int32_t>::max();
  std::int32_t second = -1;  // if there is one

  void enter(int candidate, std::int32_t candidate_distance) {
    if (candidate_distance < distance) {
      if (index >= 0) second = distance;
      index = candidate;
      distance = candidate_distance;
    } else if (second < 0 || candidate_distance < second) {
      second = candidate_distance;
    }
  }
};

void match_node(const FeatureSet& query, const Features& queries, const FeatureSet& train,
                const Features& trains, const BruteForceOptions& options,
                std::vector<DescriptorMatch>* matches) {
  std::vector<std::int32_t> distances(trains.size());
  std::vector<Best> best_query(trains.size());
  std::vector<Best> best_train;
  for (const int q : queries) {
    squared_distances(query.descriptors[static_cast<std::size_t>(q)], train.descriptors, trains,
                      distances);
    Best best;
    for (std::size_t k = 0; k < trains.size(); ++k) {
      best.enter(static_cast<int>(k), distances[k]);
      best_query[k].enter(q, distances[k]);
    }
    best_train.push_back(best);
  }
  const std::int32_t max_distance = to_squared_bytes(options.max_descriptor_distance);
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const Best& best = best_train[i];
    const auto k = static_cast<std::size_t>(best.index);
    if (best.distance > max_distance) continue;
    if (options.ratio < 1 && !passes_ratio(best.distance, best.second, options.ratio)) continue;
    if (options.mutual && best_query[k].index != queries[i]) continue;
    matches->push_back({queries[i], trains[k], best.distance});
  }
}

}  // namespace

std::vector<DescriptorMatch> match_guided(const FeatureSet& query, const DirectIndex& query_index,
                                          const FeatureSet& train, const DirectIndex& train_index,
                                          const BruteForceOptions& options) {
  std::vector<DescriptorMatch> matches;
  if (query_index.empty() || train_index.empty()) return matches;
  if (query.kind != train.kind) throw std::logic_error("descriptors of different kinds");
  std::size_t i = 0, j = 0;
  while (i < query_index.size() && j < train_index.size()) {
    if (query_index[i].node < train_index[j].node) {
      ++i;
    } else if (train_index[j].node < query_index[i].node) {
      ++j;
    } else {
      const Features queries = take_node(query_index, i);
      match_node(query, queries, train, take_node(train_index, j), options, &matches);
    }
  }
  std::sort(matches.begin(), matches.end(),
            [](const DescriptorMatch& a, const DescriptorMatch& b) { return a.query < b.query; });
  return matches;
}

}  // namespace hybrid_slam
