#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

// How far a keypoint lies from where its landmark projects.
struct ViewResidual {
  Eigen::Vector3d pixels = Eigen::Vector3d::Zero();  // u, v and, where there is one, u_right [px]
  int dimension = 2;                                 // 3 with u_right
  double sigma = 1;                                  // standard deviation of each number [px]

  double chi2() const { return pixels.squaredNorm() / (sigma * sigma); }
};

// Of a keypoint that has a landmark of the map; none if this does not project: it lies behind the
// camera.
std::optional<ViewResidual> residual_of(const MapSnapshot& map, const Keyframe& keyframe,
                                        std::uint32_t keypoint);

// What all observations by one camera say.
struct ResidualSummary {
  std::size_t observations = 0;  // that project
  std::size_t behind = 0;        // that do not
  double rms_pixels = 0;         // of each number u, v, u_right [px]
  // Of the numbers divided by their sigma. Noise as assumed gives 1 and 0.674.
  double rms = 0;
  double median = 0;  // of their absolute values
};

// By the camera's id.
std::vector<ResidualSummary> residuals_by_camera(const MapSnapshot& map);

}  // namespace hybrid_slam
