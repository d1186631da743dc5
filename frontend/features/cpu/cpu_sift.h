#pragma once

#include <string>
#include <utility>
#include <vector>

#include "frontend/features/cpu/scale_space.h"
#include "frontend/features/sift.h"
#include "frontend/features/stage_stopwatch.h"

namespace hybrid_slam {

// SIFT as defined in frontend/features/definition, on one thread. What a stage needs of the one
// before it stays in the instance, so that benchmarks can run the stages one by one; extract() is
// all of them in their order.
class CpuSift final : public SiftExtractor {
 public:
  // Throws std::invalid_argument if the options are not valid.
  explicit CpuSift(const SiftOptions& options);

  FeatureSet extract(const GrayImage& image, const GrayImage* mask) override;
  std::vector<std::pair<std::string, double>> stage_times() const override {
    return stages_.times();
  }

  // All extrema outside of the mask.
  const std::vector<sift::Extremum>& detect(const GrayImage& image, const GrayImage* mask);

  // Of the extrema last detected, those that select_spread() keeps, by place.
  std::vector<sift::Extremum> select() const;

  // A feature for each angle of each extremum; of these, those that select_spread() keeps.
  struct Oriented {
    std::vector<Keypoint> keypoints;
    std::vector<sift::Extremum> extrema;  // keypoints[i] lies at extrema[i]
    std::vector<int> by_place;            // the indices of both, in the order of `extrema` given
  };
  Oriented orient(const std::vector<sift::Extremum>& extrema) const;

  std::vector<Descriptor> describe(const Oriented& features) const;

 private:
  Keypoint keypoint_of(const sift::Extremum& extremum) const;
  sift::FixedLevel level_of(const sift::Extremum& extremum) const;
  void prefetch(const sift::Extremum& extremum, float reach) const;

  SiftOptions options_;
  sift::ScaleSpace scale_space_;
  int width_ = 0;  // of the image last given
  int height_ = 0;
  std::vector<sift::Extremum> extrema_;
  StageStopwatch stages_;
};

}  // namespace hybrid_slam
