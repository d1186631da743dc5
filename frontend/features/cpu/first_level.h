#pragma once

#include <vector>

#include "frontend/features/cpu/row_store.h"
#include "frontend/features/definition/scale_space.h"
#include "frontend/features/image.h"

namespace hybrid_slam::sift {

// A kernel of definition/scale_space.h.
struct Kernel {
  std::vector<float> weights;

  Kernel(double sigma, KernelCentre centre);
  int size() const { return static_cast<int>(weights.size()); }
  // Samples before the one that it stands at, or before the middle between two, less one.
  int reach() const { return (size() - 1) / 2; }
};

// Makes level 0 of the first octave from an image, row by row: blurred, and with `upsample` at half
// pixels, too. The doubled image itself is never formed.
class FirstLevel {
 public:
  // For images of this size.
  FirstLevel(double initial_sigma, bool upsample, int width, int height);

  // For rows y = 0, 1, ... of an image, in this order.
  void make_row(const GrayImage& image, int y, float* out);

 private:
  void read_row(const GrayImage& image, int row);
  void sum_shifted(const Kernel& kernel, float* out);

  bool upsample_;
  int width_;   // of the image
  int height_;  // of the image
  int rows_read_ = 0;
  Kernel at_sample_;
  Kernel between_;
  RowStore rows_;  // of the image, blurred and upsampled along themselves
  PaddedRow input_;
  PaddedRow even_, odd_;
  std::vector<const float*> pointers_;
};

}  // namespace hybrid_slam::sift
