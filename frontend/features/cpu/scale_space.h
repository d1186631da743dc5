#pragma once

#include <optional>
#include <vector>

#include "frontend/features/cpu/first_level.h"
#include "frontend/features/cpu/fixed_level.h"
#include "frontend/features/cpu/row_store.h"
#include "frontend/features/definition/extremum.h"
#include "frontend/features/image.h"
#include "frontend/features/sift.h"

namespace hybrid_slam::sift {

// A place in the scale space that SIFT describes.
struct Extremum {
  float x, y;                           // in the image [px]
  float scale;                          // [px]
  float response;                       // |difference of Gaussians| [grey levels]
  int octave;                           // counted from the first that there is
  int level;                            // the one that is nearest in blur
  float level_x, level_y, level_scale;  // there [samples]
};

// The Gaussian scale space of an image and the extrema of its differences. An octave is made in one
// pass over its rows, a block of them at a time: each level follows the one below it as soon as
// that has the rows that its kernel needs, and the differences of the last few rows are searched at
// once. Only the levels that features are described in are kept whole, in 16 bits. Buffers are
// allocated when the size of the image changes.
class ScaleSpace {
 public:
  explicit ScaleSpace(const SiftOptions& options);

  // Ascending by octave, layer, row and column; none if the image is smaller than kMinOctaveSize.
  // Valid, as the levels are, until the next call.
  const std::vector<Extremum>& detect(const GrayImage& image);

  // A level of the image last given, `level` in 1 .. octave_layers.
  FixedLevel level(int octave, int level) const;

 private:
  struct Octave {
    int index;   // as in the definition: -1 if upsampled
    int width;   // [samples]
    int height;  // [samples]
    std::vector<RowStore> levels;
    std::vector<FixedRowStore> whole;  // levels 1 .. layers, in 16 bits
    std::vector<RowStore> differences;
    std::vector<PaddedRow> blurred;  // a block, along the columns but not yet along the rows
  };

  void prepare(int width, int height);
  Octave make_octave(int index) const;
  void pass(const GrayImage& image, std::size_t octave);
  void make_level_rows(Octave& octave, std::size_t level, int y, int count);
  void search_row(const Octave& octave, int y);
  void collect(const Octave& octave, int number);

  int layers_;
  bool upsample_;
  double initial_sigma_;
  float contrast_threshold_;
  float edge_threshold_;
  std::vector<Kernel> kernels_;  // kernels_[k - 1] makes level k from level k - 1
  std::vector<int> lags_;        // rows by which level k follows level 0, in whole blocks
  int search_lag_;               // and the search for extrema
  int width_ = 0;                // of the image
  int height_ = 0;
  std::optional<FirstLevel> first_level_;
  std::vector<Octave> octaves_;
  std::vector<const float*> pointers_;
  std::vector<int> columns_;
  std::optional<RowStore> ranges_;  // around each sample of a row, per layer
  std::vector<float*> smallest_;    // rows of it, by layer
  std::vector<float*> largest_;
  std::vector<RefinedExtremum> refined_;  // of one octave
  std::vector<Extremum> extrema_;
};

}  // namespace hybrid_slam::sift
