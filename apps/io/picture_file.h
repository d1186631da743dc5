#pragma once

#include <filesystem>

#include <opencv2/core.hpp>

namespace hybrid_slam {

// Writes a picture, CV_8UC3 or CV_8UC1, as PNG, whole or not at all: quickly, and a bit larger than
// need be. Throws OutputError.
void write_picture(const std::filesystem::path& path, const cv::Mat& picture);

}  // namespace hybrid_slam
