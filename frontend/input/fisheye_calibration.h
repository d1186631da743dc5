#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frontend/input/file_sequence.h"

namespace hybrid_slam {

// A fisheye's calibration in any format that read_fisheye() knows, checked against the size of its
// images, which also tells the size where the file leaves it out. Throws InputError.
Calibrated<KannalaBrandt> read_fisheye_of_images(const std::filesystem::path& path, ImageSize image,
                                                 std::vector<std::string>& warnings);

// The same of a calibration that was read already, wherever from: `source` begins the complaints.
Calibrated<KannalaBrandt> fisheye_of_images(Calibrated<KannalaBrandt> camera, ImageSize image,
                                            const std::string& source);

}  // namespace hybrid_slam
