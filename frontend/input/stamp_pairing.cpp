#include "frontend/input/stamp_pairing.h"

#include "frontend/input/stamp_offset.h"
#include "frontend/input/stamp_pairs.h"

namespace hybrid_slam {
namespace {

CameraStamps stamps_of(const StampedCamera& camera) {
  CameraStamps stamps{camera.name, {}};
  for (const StampedFile& file : camera.files) stamps.stamps.push_back(file.stamp);
  return stamps;
}

}  // namespace

StampedFrames pair_by_stamps(const StampedCamera& left, const StampedCamera& right,
                             const std::string& where, const InputOptions& options,
                             std::vector<std::string>& warnings) {
  StampedFrames frames;
  for (const auto& [l, r] :
       pair_stamps(stamps_of(left), stamps_of(right), where, options.pair_tolerance, warnings)) {
    frames.times.push_back(seconds_of_stamp(left.files[l].stamp));
    frames.files.push_back({left.files[l].path, right.files[r].path, {}});
  }
  check_completeness(frames.files, where, warnings);
  return frames;
}

}  // namespace hybrid_slam
