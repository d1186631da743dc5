#pragma once

#include <filesystem>

#include <opencv2/core.hpp>

namespace hybrid_slam {

// Writes a PNG, whole or not at all. Throws OutputError.
void write_picture(const std::filesystem::path& path, const cv::Mat& picture);

}  // namespace hybrid_slam
