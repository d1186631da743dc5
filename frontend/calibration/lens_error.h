#pragma once

#include <optional>

#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

// Radial distortion that the calibration of a stereo pair has left in, alike in both cameras: what
// lies at (u, v) (in focal lengths) is seen at (1 + k (u^2 + v^2)) (u, v). A map takes nearly all
// of it up, by turning the camera a little on its way and by bending the ground, and so residuals
// show hardly any; the way becomes too short or too long by several k. What poses and landmarks
// cannot take up is small, but thousands of landmarks that cross the image tell of it.
struct LensError {
  double distortion = 0;  // k
  double sigma = 0;       // its standard deviation
  double scale = 1;       // length of the estimated way over what it would be with right lenses
  double corner = 0;      // k (u^2 + v^2) at the image's corner

  // No accident, once in a million, and more than a rig's scale may be off by.
  bool is_shown() const;
};

// One step of Gauss and Newton from the map, as bundle adjustment would do it, with k as another
// unknown: of the newest keyframes of the camera, `most` of them, in the newest one's component. By
// landmarks with a right match among their observations. None where the step is not determined.
std::optional<LensError> find_lens_error(const MapSnapshot& map, CameraId camera, std::size_t most);

}  // namespace hybrid_slam
