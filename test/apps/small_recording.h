#pragma once

#include <optional>
#include <vector>

#include "apps/slam/inputs.h"
#include "test/support/textured_ground.h"

namespace hybrid_slam {

// Images of a vehicle that moves along a textured ground at 5 Hz, small ones: a stereo pair of
// 320x240 pixels and a fisheye of 256x256.
struct SmallRecording {
  struct Moment {
    Nanoseconds time = 0;
    StereoImages stereo;
    FisheyeImage fisheye;
  };
  CameraRig cameras;
  std::vector<Moment> moments;
  std::vector<Rigid3d> world_from_left;  // truth

  static constexpr Nanoseconds kPeriod = 200'000'000;
};

// `right_roll`: by which the right camera is turned about its optical axis [rad].
SmallRecording make_small_recording(int moments, double right_roll = 0);

}  // namespace hybrid_slam
