#pragma once

#include <optional>

#include "frontend/matching/image_pyramid.h"
#include "frontend/odometry/stereo_odometer.h"

namespace hybrid_slam {

// The motion from an earlier stereo frame to a present one where the circles between them do not
// close: blur takes the right matches first. Points come from the earlier pair alone, and the
// present pose from where its left image shows them (PnP in RANSAC, then refine_pose). The level of
// the noise is that of the residuals. None if no pose is found; whether to believe it,
// StereoMotion::support says.

// By descriptors. Where the present keypoint has a right match, that counts as well.
std::optional<StereoMotion> motion_by_left_matches(const Calibrated<RectifiedStereo>& camera,
                                                   const StereoFeatures& previous,
                                                   const StereoFeatures& current);

// By patches around the earlier keypoints, no two of which overlap by more than half.
std::optional<StereoMotion> motion_by_patches(const Calibrated<RectifiedStereo>& camera,
                                              const StereoFeatures& previous,
                                              const ImagePyramid& previous_image,
                                              const ImagePyramid& current_image);

}  // namespace hybrid_slam
