#pragma once

#include "cameras/files/yaml_section.h"
#include "frontend/input/pair_calibration.h"

namespace hybrid_slam {

// Stereo pairs of other programs' settings. `image`: the size of the left
// images, where the file does not tell. All throw InputError.

// ORB-SLAM's: Camera1, Camera2 and Stereo.T_c1_c2 (raw), Camera1 and Stereo.b
// (rectified), Camera and Camera.bf (rectified; both with the matrices LEFT.*
// and RIGHT.* of raw images).
bool is_orb_pair(const YamlSection& file);
void read_orb_pair(const YamlSection& file, ImageSize image, PairCalibration& result);

// stella_vslam's, and OpenVSLAM's before: Camera and focal_x_baseline
// (rectified; both with a StereoRectifier).
bool is_stella_pair(const YamlSection& file);
void read_stella_pair(const YamlSection& file, PairCalibration& result);

// width and height of an image by these keys.
ImageSize image_size_of(const YamlSection& file, const std::string& width,
                        const std::string& height);

}  // namespace hybrid_slam
