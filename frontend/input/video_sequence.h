#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frontend/input/image_sequence.h"
#include "frontend/input/rectification.h"
#include "frontend/input/video_file.h"

namespace hybrid_slam {

// Videos of all cameras that were started together: frame n of each is of one moment.
struct Videos {
  std::unique_ptr<VideoFile> left, right;
  std::unique_ptr<VideoFile> fisheye;  // null: there is none
};

// A sequence of their frames, as many as SequenceInfo has times; rectified if there is a rectifier.
// Its read() is for one thread at a time.
std::unique_ptr<ImageSequence> make_video_sequence(
    SequenceInfo info, Videos videos, const InputOptions& options,
    std::unique_ptr<const StereoRectifier> rectifier);

}  // namespace hybrid_slam
