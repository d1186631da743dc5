#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <string>
#include <vector>

#include "frontend/input/footage.h"
#include "frontend/input/footage_images.h"
#include "test/frontend/input/dataset_writer.h"

// Small footage of a stereo pair without a layout, written by the tests.
namespace hybrid_slam::small_footage {

namespace fs = std::filesystem;

using Names = std::vector<std::string>;
using Keys = std::vector<std::int64_t>;

inline constexpr int kWidth = 96;
inline constexpr int kHeight = 64;
inline const Names kThree{"000000", "000001", "000002"};

cv::Mat picture_of(int frame, int side);

// Images of these names (without ending), in a folder.
void write_images(const fs::path& folder, const Names& names, int side);

std::string kitti_calibration();

// As YAML writes a list, with a line's end.
std::string numbers(std::initializer_list<double> values);

// EuRoC's sensor.yaml of a camera at x, turned about the vertical.
std::string sensor(double x, double turn);

// As camera_calibration writes it; the raw camera is turned by `turn` about the vertical.
std::string ros(double p3, double turn, double k1);

// Three frames in left/ and right/ with these names.
Footage write_footage(const fs::path& root, const Names& names);

std::unique_ptr<ImageSequence> open_rectified(const Footage& footage);
std::string refusal_of(const Footage& footage, FootageImages images = FootageImages::kRectified);
void check_holds(const std::string& text, const std::string& part);
void check_same_frames(const ImageSequence& a, const ImageSequence& b);

}  // namespace hybrid_slam::small_footage
