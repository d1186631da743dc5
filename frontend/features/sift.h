#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "backend/map/features.h"
#include "frontend/features/definition/parameters.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

struct SiftOptions {
  int max_features = 2000;                               // the N strongest, spread over the image
  int octave_layers = sift::kLayers;                     // scales per octave
  double contrast_threshold = sift::kContrastThreshold;  // |difference of Gaussians|, 0..255
  double edge_threshold = sift::kEdgeThreshold;          // largest ratio of principal curvatures
  double initial_sigma = sift::kInitialSigma;            // blur of the first level [px]
  bool upsample = true;  // start with an octave at twice the resolution
  // Standard deviation of a small feature's position [px]. That of a feature of scale s [px] is
  // keypoint_sigma * sqrt(1 + (s / 4)^2): measured from the row differences of stereo matches, it
  // does not grow in proportion to the scale but starts flat (rendered pairs: 0.09 px up to scale
  // 4, 0.26 at 6.8, 0.38 at 9.5; KITTI: 0.32 at 0.85, 0.36 at 1.7, 0.46 at 3.4, 0.53 at 4.8, 0.68
  // at 14). The default leaves room for change of view.
  double keypoint_sigma = 0.5;

  // Standard deviation of the position of a feature of this scale [px].
  float position_sigma(float scale) const;

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// Finds SIFT features and describes them. One instance is used by one thread at a time; the same
// image gives the same result, bit for bit, in the same order.
class SiftExtractor {
 public:
  virtual ~SiftExtractor() = default;

  // `mask`: null, or an image of the same size whose zero pixels must hold no keypoint.
  virtual FeatureSet extract(const GrayImage& image, const GrayImage* mask) = 0;

  // extract() in two steps, so that an engine with a device of its own works there while the caller
  // starts others; an engine without one does all in finish(). The image and the mask must live
  // and stay as they are until finish(), which is called once after each start().
  virtual void start(const GrayImage& image, const GrayImage* mask) {
    started_image_ = &image;
    started_mask_ = mask;
  }
  virtual FeatureSet finish() { return extract(*started_image_, started_mask_); }

  // Stages of the image last extracted, in their order, and their milliseconds. Where measuring
  // makes the whole slower, there are none unless time_stages() asked for them before.
  virtual std::vector<std::pair<std::string, double>> stage_times() const { return {}; }
  virtual void time_stages(bool /*timed*/) {}
  // The same with what a device other than the CPU does as a whole (upload, kernels, download) for
  // stages, by the device's clock: at next to no cost. Without such a device it does nothing.
  virtual void time_device(bool /*timed*/) {}

 private:
  const GrayImage* started_image_ = nullptr;
  const GrayImage* started_mask_ = nullptr;
};

// The engine for CPUs. Throws std::invalid_argument if the options are not valid.
std::unique_ptr<SiftExtractor> make_sift(const SiftOptions& options);

// For engines: the options themselves, unless they are not valid (std::invalid_argument) ...
const SiftOptions& checked(const SiftOptions& options);
// ... and nothing, unless sizes do not fit (std::logic_error).
void check_sizes(const GrayImage& image, const GrayImage* mask);

}  // namespace hybrid_slam
