#pragma once

#include <cstddef>
#include <cstdint>
#include <variant>
#include <vector>

#include "backend/map/features.h"

namespace hybrid_slam {

// Descriptors that are numbers, compared by their Euclidean distance: one after the other.
struct FloatDescriptors {
  int length = 0;             // numbers of one
  std::vector<float> values;  // [keypoint][length]
};

// Descriptors that are bits, compared by how many differ.
struct BitDescriptors {
  int bytes = 0;                     // of one
  std::vector<std::uint8_t> values;  // [keypoint][bytes]
};

// Features of one image as a method describes them: one descriptor per keypoint, in their order.
// Of keypoints that are not SIFT's, scale, angle and response mean what the method says.
struct DescribedFeatures {
  std::vector<Keypoint> keypoints;
  std::variant<std::vector<Descriptor>, FloatDescriptors, BitDescriptors> descriptors;

  std::size_t size() const { return keypoints.size(); }
};

struct FeatureMatch {
  int query = 0;
  int train = 0;
  double distance = 0;  // of unit descriptors (128 bytes), of the numbers, or bits that differ
};

// Matches that are each other's nearest and nearer than `ratio` times the query's second nearest,
// ascending by query. Equal distances go to the lower index. Throws std::logic_error if the two
// sets' descriptors are of different kinds.
std::vector<FeatureMatch> match_described(const DescribedFeatures& query,
                                          const DescribedFeatures& train, double ratio);

}  // namespace hybrid_slam
