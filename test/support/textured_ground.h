#pragma once

#include <cstdint>
#include <vector>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

// A part of a plane: x to the right, y down, up to the half sizes from its middle [m].
struct TexturedRectangle {
  Rigid3d world_from_plane;
  double half_width = 0;
  double half_height = 0;
  std::uint64_t seed = 0;  // of its texture
};

// A scene of which images can be made with exact geometry: each pixel's ray is cut with every
// rectangle, and the nearest cut gives its grey value from a texture known at every place.
class TexturedGround {
 public:
  explicit TexturedGround(std::vector<TexturedRectangle> rectangles)
      : rectangles_(std::move(rectangles)) {}

  // A tilted ground about 2.5 m ahead of the origin (along z) with blocks of several heights on it.
  static TexturedGround with_steps();

  // What a camera sees, the left one of a pair; black where no ray has the pixel.
  GrayImage render(const Camera& camera, const Rigid3d& world_from_cam) const;

 private:
  std::vector<TexturedRectangle> rectangles_;
};

}  // namespace hybrid_slam
