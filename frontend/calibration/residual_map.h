#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "frontend/calibration/image_cells.h"

namespace hybrid_slam {

// What is compared with its projection: u and v in the (left) image, and the disparity.
enum class MeasuredBy : std::size_t { kU, kV, kDisparity };
inline constexpr std::size_t kMeasured = 3;

// Residuals (projection less measurement) of the observations of one camera by place in its image
// [px], in the older and in the newer half of the keyframes that were looked at.
struct ResidualMap {
  CameraId camera;
  ImageCells cells;
  std::vector<std::array<std::array<Moments, 2>, kMeasured>> halves;  // by cell, measured, half

  Moments all(std::size_t cell, MeasuredBy measured) const {
    const auto& both = halves[cell][static_cast<std::size_t>(measured)];
    return both[0] + both[1];
  }
};

// Of the newest keyframes of the camera, `most` of them, so that what lies long back is forgotten.
ResidualMap residual_map(const MapSnapshot& map, CameraId camera, std::size_t most);

// What is systematic in it: the same in both halves, which have hardly a landmark in common. The
// product of the means of two independent halves has the square of the systematic part as its
// expectation: noise, whatever its size, averages out, and so do the errors of poses and landmarks.
struct SystematicPart {
  // By cell, its square [px^2], of u and v per coordinate, and of the disparity: mean of the
  // products over the cell and those around it, none below 0.
  std::vector<double> image;
  std::vector<double> disparity;
  double image_rms = 0;      // over all observations [px]
  double disparity_rms = 0;  // likewise
  // Standard deviations by which the products add up to more than with random signs would.
  double significance = 0;
};

SystematicPart systematic_part(const ResidualMap& map);

}  // namespace hybrid_slam
