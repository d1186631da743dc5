#include "frontend/matching/circular_matcher.h"

#include "frontend/matching/brute_force.h"

namespace hybrid_slam {
namespace {

// The features of one side that have a partner on the other, and their own indices.
struct Matched {
  FeatureSet features;
  std::vector<int> index;
};

void add(const FeatureSet& from, int index, Matched* to) {
  const auto i = static_cast<std::size_t>(index);
  to->features.keypoints.push_back(from.keypoints[i]);
  to->features.descriptors.push_back(from.descriptors[i]);
  to->index.push_back(index);
}

struct MatchedPair {
  Matched left;
  Matched right;  // in the order of `left`: the same position is the same point
};

MatchedPair matched_pair(const StereoFeatures& stereo) {
  MatchedPair pair;
  pair.left.features.kind = stereo.left.kind;
  pair.right.features.kind = stereo.right.kind;
  for (std::size_t i = 0; i < stereo.right_of_left.size(); ++i) {
    if (stereo.right_of_left[i] < 0) continue;
    add(stereo.left, static_cast<int>(i), &pair.left);
    add(stereo.right, stereo.right_of_left[i], &pair.right);
  }
  return pair;
}

}  // namespace

// The stereo legs are one-to-one, so that features without a partner cannot be part of a circle and
// are left out, and a circle closes where both temporal legs join the same two pairs, each leg
// being the best choice in both directions.
std::vector<CircularMatch> match_circular(const StereoFeatures& previous,
                                          const StereoFeatures& current,
                                          const CircularMatcherOptions& options) {
  const MatchedPair from = matched_pair(previous);
  const MatchedPair to = matched_pair(current);
  const BruteForceOptions brute_force{.max_descriptor_distance = options.max_descriptor_distance};
  const std::vector<DescriptorMatch> right =
      match_brute_force(from.right.features, to.right.features, brute_force);
  const std::vector<DescriptorMatch> left =
      match_brute_force(from.left.features, to.left.features, brute_force);

  std::vector<CircularMatch> circles;
  auto r = right.begin();
  for (const DescriptorMatch& l : left) {
    while (r != right.end() && r->query < l.query) ++r;
    if (r == right.end()) break;
    if (r->query != l.query || r->train != l.train) continue;
    circles.push_back({from.left.index[static_cast<std::size_t>(l.query)],
                       to.left.index[static_cast<std::size_t>(l.train)]});
  }
  return circles;
}

}  // namespace hybrid_slam
