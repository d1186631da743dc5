#pragma once

#include <filesystem>
#include <span>

#include "apps/io/trajectory.h"

namespace hybrid_slam {

// The error of each frame of one camera: estimate and truth after the alignment of the whole.
struct ErrorsOfCamera {
  const char* camera = "";
  std::span<const StampedPose> estimate;
  std::span<const StampedPose> truth;
};

// errors.csv: per frame that has a true position, its distance from it [m] and the true position in
// the map's frame; without cameras the header alone. Both cameras are aligned by the left one's
// path, as ATE is. Throws OutputError.
void write_errors(const std::filesystem::path& path, std::span<const ErrorsOfCamera> cameras,
                  const Sim3d& truth_from_estimate, double max_difference);

}  // namespace hybrid_slam
