#pragma once

#include <memory>
#include <optional>

#include "frontend/input/file_sequence.h"
#include "frontend/input/footage.h"

// The cameras of own footage, by its calibration files. None of this opens images.
namespace hybrid_slam {

// Of the images as they are stored.
struct FootageSizes {
  ImageSize left;
  std::optional<ImageSize> right;  // none: checked when each image is read
  ImageSize fisheye;               // if there is one
};

// What the calibration allows left images of this size to be. Throws InputError as below.
FootageMeanings footage_meanings(const Footage& footage, ImageSize left);

// Sets info.stereo and info.fisheye, adds to info.warnings, and returns what rectifies the pair's
// images; null for rectified ones. Throws InputError if the calibration does not say what `images`
// are, is one of another size, or of more or fewer cameras.
std::unique_ptr<const StereoRectifier> read_footage_cameras(const Footage& footage,
                                                            FootageImages images,
                                                            const FootageSizes& sizes,
                                                            SequenceInfo& info);

}  // namespace hybrid_slam
