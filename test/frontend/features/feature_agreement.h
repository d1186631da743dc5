#pragma once

#include "backend/map/features.h"

namespace hybrid_slam {

bool same_bytes(const FeatureSet& a, const FeatureSet& b);

// How much of a first set of features a second one has.
struct FeatureAgreement {
  double found = 1;                    // share of keypoints within 0.1 px and 2 % of the scale
  double median_angle = 0;             // between orientations of those found [deg]
  double median_descriptor_angle = 0;  // between their descriptors [deg]
  int worst_byte = 0;                  // of descriptors whose orientations differ by < 0.5 deg
};

// Where several keypoints are near enough, the one of the nearest orientation counts.
FeatureAgreement feature_agreement(const FeatureSet& a, const FeatureSet& b);

}  // namespace hybrid_slam
