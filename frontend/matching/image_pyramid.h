#pragma once

#include <cstdint>
#include <vector>

#include "frontend/features/image.h"

namespace hybrid_slam {

// A smoothed grey image and its halvings, for sub-pixel alignment. Pixel (x, y) of level k shows
// the image at (2^k x, 2^k y). Each level carries the same blur in its own pixels, so that
// interpolation between pixels is accurate. Immutable once built.
class ImagePyramid {
 public:
  // Pixels are numbers of 16 bits in units of 1 / kUnits grey levels: trackers keep the images of
  // many keyframes, and what rounding takes away is far below the noise of any image.
  static constexpr float kUnits = 256;

  struct Level {
    int width = 0;
    int height = 0;
    std::vector<std::uint16_t> pixels;

    const std::uint16_t* row(int y) const {
      return pixels.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
    }
  };

  // `blur`: standard deviation of the smoothing [px of each level]. Stops before `levels` where a
  // further level would have fewer than 16 rows or columns. Throws std::logic_error on an empty
  // image.
  explicit ImagePyramid(const GrayImage& image, int levels = 5, double blur = 0.8);

  int levels() const { return static_cast<int>(levels_.size()); }
  const Level& level(int k) const { return levels_[static_cast<std::size_t>(k)]; }

 private:
  std::vector<Level> levels_;
};

}  // namespace hybrid_slam
