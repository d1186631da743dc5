#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "frontend/input/file_sequence.h"

namespace hybrid_slam {

enum class ImageSide { kLeft, kRight, kSingle };

// Nanoseconds of a keyframe's time.
std::int64_t nanoseconds_of(const Keyframe& keyframe);

// Which dive a keyframe is of, from 0: in a map of several, the time of a camera's keyframes goes
// back where the next one begins.
std::map<KeyframeId, std::size_t> runs_of(const MapSnapshot& map);

// How the images of keyframes are called. Those of a dive whose dataset is given (in the order of
// the dives): as their files are, below the dataset's folder. Others by their time:
// left/0000000012300000000.png; right/, fisheye/ likewise, with the camera's number from the second
// of a kind on ("left2"), below run2/ from the second dive on.
class ImageNames {
 public:
  // Throws InputError for a folder that is no dataset or that has no image of a keyframe's time.
  ImageNames(const MapSnapshot& map, const std::vector<std::string>& datasets);

  std::string name(const Keyframe& keyframe, ImageSide side) const;

  // Where the image is, if that is known.
  std::optional<std::filesystem::path> file(const Keyframe& keyframe, ImageSide side) const;

  // Images of stereo pairs that the dataset has raw, while the map is of rectified ones: such files
  // are written anew, below `folder`, under their names with .png at the end. How many were
  // written.
  std::size_t write_rectified(const std::filesystem::path& folder) const;

 private:
  struct Dataset {
    std::filesystem::path folder;
    std::unique_ptr<ImageSequence> images;
    const FileSequence& files() const { return dynamic_cast<const FileSequence&>(*images); }
  };

  std::filesystem::path path_of(const Keyframe& keyframe, ImageSide side) const;
  const Dataset* dataset_of(const Keyframe& keyframe) const;
  bool is_rectified(const Keyframe& keyframe, ImageSide side) const;

  const MapSnapshot& map_;
  std::vector<Dataset> datasets_;
  std::map<KeyframeId, std::size_t> runs_;
  std::map<KeyframeId, std::size_t> frames_;  // of the dataset
};

}  // namespace hybrid_slam
