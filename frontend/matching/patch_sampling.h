#pragma once

#include <cstddef>

#include <Eigen/Core>

#include "frontend/matching/image_pyramid.h"

namespace hybrid_slam {

constexpr int kMaxPatchHalfSize = 50;

// The samples [grey levels] of a square of whole steps around (cx, cy), row by row: all share the
// same weights, so that rows and columns can be interpolated one after the other. Catmull-Rom
// interpolation between pixels, which needs floor(x) in 1 .. width - 3 and floor(y) in
// 1 .. height - 3 of every sample. To the last bit the same on every machine.
void sample_square(const ImagePyramid::Level& level, double cx, double cy, int half_size,
                   float* samples);

// The same of a square that is turned and sheared: a step along a row of it is one of the first
// column of `warp`, a step to the next row one of the second.
void sample_warped(const ImagePyramid::Level& level, const Eigen::Vector2d& centre,
                   const Eigen::Matrix2d& warp, int half_size, float* samples);

// Sums of the products of each two of so many columns that follow one another in memory: all in
// double, row by row, since differences between them will count.
constexpr int kSummedColumns = 8;
using SummedProducts = Eigen::Matrix<double, kSummedColumns, kSummedColumns>;
SummedProducts sums_of_products(const float* columns, std::size_t rows);

}  // namespace hybrid_slam
