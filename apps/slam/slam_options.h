#pragma once

#include <cstdint>
#include <string>

#include "backend/backend.h"
#include "frontend/features/sift.h"
#include "frontend/input/fisheye_view.h"
#include "frontend/mapping/culling.h"
#include "frontend/mapping/fusion.h"
#include "frontend/mapping/triangulation.h"
#include "frontend/matching/stereo_matcher.h"
#include "frontend/place_recognition/loop_finder.h"
#include "frontend/tracking/fisheye_tracker.h"
#include "frontend/tracking/stereo_tracker.h"

namespace hybrid_slam {

// Whether SIFT starts with an octave at twice the resolution.
enum class Upsampling {
  kAuto,  // the first pairs decide, see choose_upsampling(); on where nobody asks them
  kOn,
  kOff,
};

// What concerns the fisheye alone.
struct FisheyeOptions {
  bool upsample = true;  // as of SIFT; the rest of its options holds for all cameras
  FisheyeViewOptions view;
  FisheyeTrackerOptions tracking;
  // The stereo pair's min_tracked_ratio where there is a fisheye, if that is more: the fisheye
  // looks from other sides and is placed by what many stereo keyframes have seen.
  double stereo_tracked_ratio = 0.75;
};

// Files of images of the calibrated size: where one is zero, the stereo pair's left or right image
// never shows anything of the world (the vehicle's frame, a lamp). Empty: none.
struct MaskOptions {
  std::string left;
  std::string right;
};

// Loop closing.
struct LoopOptions {
  bool enabled = true;
  LoopFinderOptions finder;
};

// Everything that can be set, in one value. Read from YAML at the border only.
struct SlamOptions {
  int features = 2000;  // N: per image; also the measure of the tracker's shares
  std::uint64_t seed = 0;
  // Whether right images are re-warped where the first pairs show them out of row (PairAlignment).
  bool align_pair = true;
  SiftOptions sift;
  Upsampling upsampling = Upsampling::kAuto;  // of the stereo pair; sift.upsample follows it
  StereoMatcherOptions stereo;
  MaskOptions masks;
  StereoTrackerOptions tracking;
  FisheyeOptions fisheye;
  TriangulationOptions triangulation;
  FusionOptions fusion;
  CullingOptions culling;
  LoopOptions loops;
  BackendOptions backend;

  // Hands `features`, `seed` and `upsampling` down to the parts that use them.
  void distribute();

  // Empty if the values can be used, else what is wrong.
  std::string validate() const;
};

// Reads options over the defaults. Throws InputError with file, line and key: not readable, an
// unknown key, a value of the wrong type, or one out of range.
SlamOptions read_slam_options(const std::string& path);

// All options as read_slam_options() reads them, exactly.
std::string write_slam_options(SlamOptions options);

}  // namespace hybrid_slam
