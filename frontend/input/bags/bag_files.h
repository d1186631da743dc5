#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace hybrid_slam {

// The files of recorded messages that a path stands for: itself, or those of a folder, as rosbag2's
// metadata.yaml lists them or, without one, by name. Throws InputError if there are none; a file
// that is listed and missing is a line in `warnings`.
std::vector<std::filesystem::path> list_bag_files(const std::filesystem::path& path,
                                                  std::vector<std::string>& warnings);

// Whether the path is a file, or a folder that rosbag2 wrote (metadata.yaml) or that holds bags and
// no folders.
bool is_bag(const std::filesystem::path& path);

}  // namespace hybrid_slam
