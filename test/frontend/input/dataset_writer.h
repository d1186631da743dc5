#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "frontend/input/image_sequence.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {

// A picture whose pixels tell a wrong row, column, frame or side.
inline cv::Mat test_picture(int width, int height, int seed) {
  cv::Mat picture(height, width, CV_8UC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      picture.at<std::uint8_t>(y, x) =
          static_cast<std::uint8_t>((7 * x + 13 * y + 31 * seed + x * y) % 251);
    }
  }
  return picture;
}

inline void write_picture(const std::filesystem::path& path, const cv::Mat& picture) {
  std::filesystem::create_directories(path.parent_path());
  REQUIRE(cv::imwrite(path.string(), picture));
}

inline void replace_text(const std::filesystem::path& path, const std::string& from,
                         const std::string& to) {
  std::string text = read_text(path);
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  write_text(path, text.replace(at, from.size(), to));
}

inline void truncate_file(const std::filesystem::path& path) {
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
}

// What an action complains of, or "" if it does not. Anything but one clear line fails the test.
inline std::string complaint(const std::function<void()>& action) {
  try {
    action();
  } catch (const InputError& error) {
    const std::string line = error.what();
    CHECK(line.find('\n') == std::string::npos);
    CHECK(line.size() > 10);
    return line;
  }
  return "";
}

inline std::string open_complaint(const std::filesystem::path& path, const std::string& name = "",
                                  SequenceLayout layout = SequenceLayout::kAuto) {
  return complaint([&] { open_sequence(path.string(), layout, name); });
}

inline bool holds(const GrayImage& image, const cv::Mat& picture) {
  return image.width == picture.cols && image.height == picture.rows &&
         std::equal(image.pixels.begin(), image.pixels.end(), picture.begin<std::uint8_t>(),
                    picture.end<std::uint8_t>());
}

}  // namespace hybrid_slam
