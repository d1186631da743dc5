#pragma once

#include <filesystem>
#include <vector>

#include "apps/feature_eval/methods/described_features.h"
#include "backend/map/features.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

// PNGs, small images enlarged by a whole factor. Both throw OutputError.

// The image with a circle of three scales around each keypoint, coloured by the scale, and a line
// from its centre along its angle.
void write_keypoint_picture(const std::filesystem::path& path, const GrayImage& image,
                            const std::vector<Keypoint>& keypoints);

// Both images side by side with a line for each match, coloured by its height in the first one:
// where matches are right, the colours of the second image run as those of the first.
void write_match_picture(const std::filesystem::path& path, const GrayImage& first,
                         const std::vector<Keypoint>& first_keypoints, const GrayImage& second,
                         const std::vector<Keypoint>& second_keypoints,
                         const std::vector<FeatureMatch>& matches);

}  // namespace hybrid_slam
