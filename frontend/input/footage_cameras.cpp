#include "frontend/input/footage_cameras.h"

#include <filesystem>

#include "frontend/input/fisheye_calibration.h"
#include "frontend/input/footage_calibration.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

// Of KITTI's pairs: folders of its colour cameras are called image_2 or image_02.
bool is_color(const Footage& footage) {
  const std::string path = fs::absolute(footage.left.front()).lexically_normal().string();
  return path.find("image_2") != std::string::npos || path.find("image_02") != std::string::npos;
}

void check_calibrations(const Footage& footage, const PairCalibration& pair) {
  const std::size_t wanted = pair.files_used + (footage.fisheye.empty() ? 0 : 1);
  if (footage.calibration.size() < wanted) {
    throw InputError(pair.source + ": is the pair's calibration; that of the fisheye must follow");
  }
  if (footage.calibration.size() > wanted) {
    throw InputError(footage.calibration[wanted] + ": is one calibration too many; the pair's is " +
                     pair.source + (footage.fisheye.empty() ? ", and no fisheye was given" : ""));
  }
}

std::unique_ptr<const StereoRectifier> take_calibration(const PairCalibration& pair,
                                                        FootageImages images, ImageSize size,
                                                        SequenceInfo& info) {
  if (images == FootageImages::kRectified) {
    if (!pair.rectified) {
      throw InputError(pair.source +
                       ": says how raw images are made, not what holds of rectified "
                       "ones: give the rectified pair's calibration");
    }
    take_rectified_pair(pair, info);
    check_image_size(size, {info.stereo.width, info.stereo.height}, pair.source);
    return nullptr;
  }
  if (!pair.raw) {
    throw InputError(pair.source +
                     ": is a rectified pair's calibration and does not tell how to "
                     "rectify raw images");
  }
  check_image_size(size, pair.raw->left.size, pair.source);
  return take_raw_pair(pair, info);
}

PairCalibration read_pair(const Footage& footage, ImageSize size) {
  PairCalibration pair = read_pair_calibration(footage.calibration, is_color(footage), size);
  check_calibrations(footage, pair);
  return pair;
}

}  // namespace

FootageMeanings footage_meanings(const Footage& footage, ImageSize left) {
  const PairCalibration pair = read_pair(footage, left);
  return {pair.raw.has_value(), pair.rectified.has_value()};
}

std::unique_ptr<const StereoRectifier> read_footage_cameras(const Footage& footage,
                                                            FootageImages images,
                                                            const FootageSizes& sizes,
                                                            SequenceInfo& info) {
  const PairCalibration pair = read_pair(footage, sizes.left);
  auto rectifier = take_calibration(pair, images, sizes.left, info);
  if (sizes.right) {
    check_image_size(*sizes.right, rectifier ? rectifier->right_size() : sizes.left,
                     pair.source + ": right camera");
  }
  if (!footage.fisheye.empty()) {
    info.fisheye = read_fisheye_of_images(footage.calibration.back(), sizes.fisheye, info.warnings);
  }
  return rectifier;
}

}  // namespace hybrid_slam
