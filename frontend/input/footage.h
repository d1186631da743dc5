#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frontend/input/image_sequence.h"

// Images that lie in no known layout, as their owner names them.
namespace hybrid_slam {

// Each camera is a folder, a pattern, or files, see list_footage(); or one video, told by its name.
struct Footage {
  std::vector<std::string> left, right;
  std::vector<std::string> fisheye;      // empty: there is none
  std::vector<std::string> calibration;  // of the pair, then that of the fisheye
  std::string times;                     // file; empty: by the images' names, or by `rate`
  double rate = 0;                       // [Hz]; 0: not known
};

enum class FootageImages { kRaw, kRectified };

// What the calibration allows the pair's images to be.
struct FootageMeanings {
  bool raw = false;
  bool rectified = false;
};
FootageMeanings footage_meanings(const Footage& footage);

// Left and right belong together by their numbers, by their times, or where names tell neither by
// their order; so does the fisheye. Times come from `times`: a row per frame or, where fewer
// images are there than rows, row n for the images of number n; rows may be "time name-of-the-left-
// image", or KITTI's dates. Else they are those of the names, or number over rate.
//
// Frames of videos belong together by their numbers; their times are those of the left video. Read
// a sequence of videos by one thread at a time.
//
// Raw images are rectified when read. Throws InputError as open_sequence() does, if there are no
// times, or if the calibration does not say what `images` are.
std::unique_ptr<ImageSequence> open_footage(const Footage& footage, FootageImages images,
                                            const InputOptions& options);

}  // namespace hybrid_slam
