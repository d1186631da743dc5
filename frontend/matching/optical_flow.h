#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "frontend/matching/image_pyramid.h"

namespace hybrid_slam {

// Where a point of one image went in another.
struct FlowMatch {
  int point = 0;               // index of the point
  Eigen::Vector2f position{};  // in the other image [px]
};

constexpr float kFlowReach = 150;  // [px] either way

// Follows the patches around `points` [px] from one image to another by pyramidal Lucas-Kanade
// (Bouguet 2000; OpenCV's calcOpticalFlowPyrLK), without a prediction: motions up to some
// kFlowReach. Needs neither corners nor descriptors, and so goes on where blur takes both. Kept is
// what comes back to within a pixel when it is followed backwards. Ascending by point.
std::vector<FlowMatch> follow_patches(const ImagePyramid& from, const ImagePyramid& to,
                                      std::span<const Eigen::Vector2f> points);

}  // namespace hybrid_slam
