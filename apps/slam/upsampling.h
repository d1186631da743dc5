#pragma once

#include <memory>
#include <span>
#include <string>

#include "apps/slam/inputs.h"
#include "apps/slam/slam_options.h"

namespace hybrid_slam {

// What the first pairs say of SIFT without upsampling; see choose_upsampling().
struct UpsamplingEvidence {
  // "option", "fisheye", "first pairs", or why these tell nothing: "unreadable pairs" (there are
  // none), "no matches".
  std::string chosen_by;
  int features = 0;         // in an image, the fewest
  double feature_size = 0;  // median scale over focal length, of those with a right match [rad]
};

// Settles Upsampling::kAuto before the first frame, for the whole run: afterwards it is kOn or
// kOff, and options.sift.upsample agrees.
//
// Upsampling finds features of 0.6 times the size, at 2.7 times the time of SIFT. They are worth it
// where an image alone does not fill the budget of features, and where its features are large as
// angles: what does not average out (relief and shade inside a patch, its perspective) grows with
// their size in the scene. Surveys and streets lose half of their accuracy or more without it at 3
// to 5 mrad, and keep it at the 1.8 to 2.3 mrad that upsampling gives them (docs/sift.md): so SIFT
// goes down to 2 mrad. A fisheye in the same map looks from nearer by and needs the stereo pair's
// small features: with it, there is upsampling.
UpsamplingEvidence choose_upsampling(const CameraRig& cameras,
                                     std::span<const std::shared_ptr<const StereoImages>> pairs,
                                     SlamOptions& options);

}  // namespace hybrid_slam
