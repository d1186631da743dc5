#pragma once

#include <memory>
#include <string>
#include <vector>

#include "frontend/input/bags/topics.h"
#include "frontend/input/image_sequence.h"

namespace hybrid_slam {

struct BagOptions {
  CameraTopics topics;  // those not given are found by type and name
  // Files, see read_pair_calibration(), then that of the fisheye; where they describe raw and
  // rectified images, these are rectified. Empty: the CameraInfo messages of the bags.
  std::vector<std::string> calibration;
};

// Opens bags that follow one another as one sequence: ROS 1, or ROS 2 as sqlite3 or MCAP, see
// open_bag(). Times are those of the messages' headers. Images are read from the files when they
// are asked for; opening reads the beginning of each image's message, for which compressed chunks
// are decompressed once.
//
// Throws InputError with one clear line as open_bag() and choose_topics() do; if a pair's times do
// not meet; if there is no calibration, or not for images of this size. Goes on with a line in
// SequenceInfo::warnings if a file is cut off, if times are there twice, or images have no partner.
std::unique_ptr<ImageSequence> open_bags(const std::vector<std::string>& paths,
                                         SequenceCameras cameras, const BagOptions& bag_options,
                                         const InputOptions& options);

}  // namespace hybrid_slam
