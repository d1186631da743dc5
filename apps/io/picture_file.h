#pragma once

#include <filesystem>

#include <opencv2/core.hpp>

namespace hybrid_slam {

// Writes a picture of CV_8UC3 as PNG, whole or not at all. Throws OutputError.
void write_picture(const std::filesystem::path& path, const cv::Mat& picture);

}  // namespace hybrid_slam
