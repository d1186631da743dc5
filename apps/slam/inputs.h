#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <variant>

#include "cameras/camera.h"
#include "frontend/features/image.h"
#include "frontend/tracking/frame.h"

namespace hybrid_slam {

// Time of the sensors' common clock [ns]; from any origin.
using Nanoseconds = std::int64_t;

// To the nearest nanosecond. A time that was read as seconds comes back as the same number, as long
// as doubles of its size are coarser than a nanosecond, or it has at most nine digits behind the
// point.
inline Nanoseconds to_nanoseconds(double seconds) {
  return std::llroundl(static_cast<long double>(seconds) * 1e9L);
}
inline double to_seconds(Nanoseconds time) {
  return static_cast<double>(static_cast<long double>(time) / 1e9L);
}

enum class CameraKind { kStereo, kFisheye };

const char* to_string(CameraKind camera);

// The cameras of a vehicle: a stereo pair, and a fisheye that moves by itself or none.
struct CameraRig {
  Calibrated<RectifiedStereo> stereo;
  std::optional<Calibrated<KannalaBrandt>> fisheye;
};

// A rectified, row-aligned pair of grey images of the calibrated size. `mask`, of the left image:
// its zero pixels show nothing of the world; empty: all of them do.
struct StereoImages {
  Nanoseconds time = 0;
  GrayImage left;
  GrayImage right;
  GrayImage mask{};
};

// A raw grey image of the fisheye. `mask` as above.
struct FisheyeImage {
  Nanoseconds time = 0;
  GrayImage image;
  GrayImage mask{};
};

// Features instead of images, for those who extract them otherwise: made by make_frame() or
// make_mono_frame(). The frame's own index and time do not count.
struct ExtractedFrame {
  Nanoseconds time = 0;
  CameraKind camera = CameraKind::kStereo;
  Frame frame;
};

// What can be handed to a Session.
using SensorInput = std::variant<StereoImages, FisheyeImage, ExtractedFrame>;

Nanoseconds time_of(const SensorInput& input);
CameraKind camera_of(const SensorInput& input);

// A frame of either camera, ready to be tracked.
struct CameraFrame {
  CameraKind camera = CameraKind::kStereo;
  Nanoseconds time = 0;
  Frame frame;
};

}  // namespace hybrid_slam
