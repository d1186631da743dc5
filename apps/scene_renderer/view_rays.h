#pragma once

#include <vector>

#include <Eigen/Core>

#include "apps/scene_renderer/lens.h"

namespace hybrid_slam {

inline constexpr int kHazeCell = 16;  // [px] between the nodes at which the haze is computed

// The rays of a camera's pixels, by its own model: computed once, used for every image.
struct ViewRays {
  int width = 0;
  int height = 0;
  // Unit bearing of each pixel's centre and how it changes per pixel to the right and down (central
  // differences over one pixel: exact within it to 0.004 px). Zero outside the field of view.
  std::vector<Eigen::Vector3f> bearing, right, down;
  // Where each ray cuts the camera's axis [m]; empty if all do so in the camera's centre.
  std::vector<float> shift;

  // Bearings at every kHazeCell-th pixel, from (0, 0) to beyond the last; of the nearest pixel
  // that has one where the model has none.
  int node_columns = 0;
  int node_rows = 0;
  std::vector<Eigen::Vector3f> node_bearing;

  bool sees(std::size_t pixel) const { return !bearing[pixel].isZero(); }
};

// `max_angle`: half the field of view [rad]; pixels whose ray lies beyond see nothing. The first
// image of a stereo pair is meant (RectifiedStereo: the left one).
ViewRays make_view_rays(const Lens& lens, double max_angle, int threads);

}  // namespace hybrid_slam
