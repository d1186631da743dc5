#pragma once

#include <string>

#include "cameras/camera.h"
#include "frontend/input/bags/messages.h"
#include "frontend/input/pair_calibration.h"

namespace hybrid_slam {

// Cameras from CameraInfo messages (K, D, R and P as ROS' image_pipeline means them). All throw
// InputError, beginning with `source`: a camera that is not calibrated, numbers that cannot be its,
// binning or a region of interest.

// Whether the images that the message describes need no rectification: no distortion, no rotation,
// K and P alike.
bool is_rectified(const CameraInfoMessage& info);

// A pair of rectified images, from P of both.
Calibrated<RectifiedStereo> rectified_pair(const CameraInfoMessage& left,
                                           const CameraInfoMessage& right,
                                           const std::string& source);

// A raw pair: K and D of each, and between them what R and P of both say.
RawPair raw_pair(const CameraInfoMessage& left, const CameraInfoMessage& right,
                 const std::string& source);

// The lens of a fisheye: distortion_model equidistant, fisheye or kannala_brandt, D of 4 numbers.
Calibrated<KannalaBrandt> fisheye_camera(const CameraInfoMessage& info, const std::string& source);

}  // namespace hybrid_slam
