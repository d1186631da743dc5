#pragma once

#include <functional>
#include <vector>

#include "frontend/features/image.h"

namespace hybrid_slam {

// value(x, y) for every pixel, rounded and cut to 0..255.
GrayImage to_image(int width, int height, const std::function<double(double, double)>& value);

// A Gaussian of this standard deviation [px] around (x, y).
struct Blob {
  double x, y, sigma;
};

// Blobs of this amplitude on grey 60; each pixel shows the mean over its area.
GrayImage blob_image(int width, int height, const std::vector<Blob>& blobs, double amplitude);

// Random texture: many bright and dark blobs.
GrayImage texture(int width, int height, unsigned seed);

}  // namespace hybrid_slam
