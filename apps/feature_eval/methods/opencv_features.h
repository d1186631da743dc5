#pragma once

#include <memory>
#include <string>
#include <vector>

#include "apps/feature_eval/feature_method.h"

namespace hybrid_slam {

// The names of OpenCV's features here: "cv_sift", "cv_rootsift", "orb", "akaze", "kaze", "brisk",
// "surf".
const std::vector<std::string>& opencv_feature_names();

// Empty if OpenCV was built with the features of this name, else why not, in one line.
std::string why_no_opencv_features(const std::string& name);

// Features as OpenCV finds and describes them with its own parameters, but for the thresholds of
// detection, which are so low that hazy images have `max_features` as well (docs/feature_study.md),
// of which the strongest are kept; equal ones in the order of y, x, scale and angle. SIFT's
// threshold is ours, and its places lose OpenCV 4.6's offset of 0.25 px. Keypoint::scale is half
// OpenCV's diameter, response as the detector gives it. Works with one thread. Throws
// std::logic_error for a name that cannot be used.
std::unique_ptr<FeatureMethod> make_opencv_features(const std::string& name, int max_features);

}  // namespace hybrid_slam
