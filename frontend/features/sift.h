#pragma once

#include <memory>
#include <string>

#include "backend/map/features.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

struct SiftOptions {
  int max_features = 2000;          // the N strongest, spread over the image
  int octave_layers = 3;            // scales per octave
  double contrast_threshold = 1.2;  // smallest |difference of Gaussians|, grey levels 0..255
  double edge_threshold = 10;       // largest ratio of principal curvatures
  double initial_sigma = 1.6;       // blur of the first level [px]
  bool upsample = true;             // start with an octave at twice the resolution
  double keypoint_sigma = 0.5;      // standard deviation of a position per pixel of scale [-]

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
};

// Throws std::invalid_argument if the options are not valid.
std::unique_ptr<SiftExtractor> make_sift(const SiftOptions& options);

}  // namespace hybrid_slam
