#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/slam/live/image_set.h"

namespace hybrid_slam {

// Writes sets of images as own footage is laid out, in a folder of its own:
//   left/<UNIX time in ns>.png, right/..., fisheye/...   the images as the cameras gave them, grey
//   calibration/<n>_<name>                               copies of the calibration's files
// A reader never sees half an image; of a set the left one comes last.
class SetRecorder {
 public:
  // Throws OutputError if the folder cannot be written to or holds a recording, InputError for the
  // calibration.
  SetRecorder(std::filesystem::path folder, const std::vector<std::string>& calibration,
              bool fisheye);

  // Returns what went wrong in one line, after which nothing is written any more; else nothing.
  std::string add(const ImageSet& set);

  std::size_t recorded() const { return recorded_; }  // sets
  bool failed() const { return failed_; }

  // The copies, in order.
  const std::vector<std::string>& calibration() const { return calibration_; }

 private:
  std::filesystem::path path_of(LiveCamera camera, std::int64_t stamp) const;
  void write(LiveCamera camera, std::int64_t stamp, const GrayImage& image) const;

  std::filesystem::path folder_;
  std::vector<std::string> calibration_;
  std::size_t recorded_ = 0;
  bool failed_ = false;
};

}  // namespace hybrid_slam
