#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "frontend/input/file_sequence.h"

// Images of cameras that each have times of their own.
namespace hybrid_slam {

struct StampedFile {
  std::int64_t stamp = 0;      // [ns]
  std::filesystem::path path;  // empty if the file is missing
};

// Ascending in time, and how messages call the camera: "cam0".
struct StampedCamera {
  std::string name;
  std::vector<StampedFile> files;
};

struct StampedFrames {
  std::vector<double> times;  // of the left images [s]
  std::vector<FramePaths> files;
};

// Pairs what was taken at the same time, up to options.pair_tolerance; an offset that all pairs
// have in common is one of the clocks, or of the triggers, and is taken out with a warning. Images
// without a partner are left out and counted. Neither camera is without files. Throws InputError,
// starting with `where`, if no pair is left, or as check_completeness().
StampedFrames pair_by_stamps(const StampedCamera& left, const StampedCamera& right,
                             const std::string& where, const InputOptions& options,
                             std::vector<std::string>& warnings);

}  // namespace hybrid_slam
