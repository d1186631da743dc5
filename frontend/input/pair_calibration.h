#pragma once

#include <memory>
#include <optional>
#include <string>

#include "frontend/input/file_sequence.h"

namespace hybrid_slam {

// Two raw cameras and how they stand.
struct RawPair {
  RawCamera left, right;
  Rigid3d right_from_left;
};

// What is known of a pair of cameras: how the raw images are made, what holds of the images once
// they are rectified, or both; at least one is there.
struct PairCalibration {
  std::optional<Calibrated<RectifiedStereo>> rectified;
  std::optional<RawPair> raw;
  std::string source;              // the files, for messages
  std::vector<std::string> notes;  // how raw lenses of other models were taken
  std::size_t files_used = 0;      // of those given, from the first on
};

// Takes the pair for one whose images are rectified already, or are to be rectified by what is
// returned: sets info.stereo, adds to info.warnings. The calibration must hold of such images.
// Throw InputError if it cannot be a pair's.
void take_rectified_pair(const PairCalibration& pair, SequenceInfo& info);
std::unique_ptr<const StereoRectifier> take_raw_pair(const PairCalibration& pair,
                                                     SequenceInfo& info);

}  // namespace hybrid_slam
