#pragma once

#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "apps/slam/live/image_set.h"
#include "frontend/input/footage_cameras.h"
#include "frontend/input/image_sequence.h"
#include "frontend/input/rectification.h"

namespace hybrid_slam {

// What the cameras are, settled by the calibration and the first sets.
struct LiveCameras {
  SequenceInfo info;  // without times
  FootageSizes sizes;
  std::unique_ptr<const StereoRectifier> rectifier;  // null: the images are rectified
  FootageImages images = FootageImages::kRaw;
  std::vector<ImageSet> first;  // that were looked at; they come before all others

  // Why a set is none of these cameras; empty: it is.
  std::string complaint(const ImageSet& set) const;
};

// Reads the calibration as own footage's is read. `footage` names the sources for messages and has
// the calibration's files. Where `images` says nothing and the calibration allows both, the rows of
// the first five pairs tell. Empty if there is no set before the source ends, or `stop` is
// requested. Throws InputError as open_footage() and the source do.
std::optional<LiveCameras> settle_cameras(SetSource& source, const Footage& footage,
                                          std::optional<FootageImages> images,
                                          const std::stop_token& stop);

}  // namespace hybrid_slam
