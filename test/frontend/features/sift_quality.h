#pragma once

#include <string>
#include <vector>

#include "frontend/features/sift.h"

namespace hybrid_slam {

// How well features of two images of one scene agree, where it is known what should agree.
struct PairQuality {
  double features = 0;  // in both images together
  double visible = 0;   // places in the first image that the second one shows
  double repeated = 0;  // of them, with a feature at the right place and of the right scale
  double matches = 0;   // nearest neighbours that pass the ratio test (0.8)
  double correct = 0;   // of them, at the right place
  double error = 0;     // sum of the correct ones' distances from the right place [px]

  PairQuality& operator+=(const PairQuality& other);
};

// A kind of pair and what all pairs of it came to.
struct QualityRow {
  std::string kind;
  int pairs = 0;
  PairQuality sum;
};

// Copies of images under rotation, scaling, perspective, blur, noise and less contrast: rows by
// kind, in this order. `folder` holds images, also in folders below; every so many of them, in the
// order of their names, are used, `count` in all.
std::vector<QualityRow> warped_copies(SiftExtractor& sift, const std::string& folder, int count);

// Left and right images 0, step, 2 * step, ... of UWslam's hybrid layout: right is a row that
// differs by 1 px at most.
QualityRow stereo_pairs(SiftExtractor& sift, const std::string& folder, int step);

}  // namespace hybrid_slam
