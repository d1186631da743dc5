#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "cameras/camera.h"
#include "frontend/features/image.h"
#include "frontend/features/image_quality.h"
#include "frontend/matching/pair_check.h"
#include "frontend/tracking/frame.h"

namespace hybrid_slam {

struct PairAlignment;

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

// What is known of an input beside its features; see Diagnosis.
struct FrameEvidence {
  std::vector<ImageQuality> images;  // left and right, or the fisheye's; empty of features alone
  double masked = 0;                 // share of the image that the input's own mask covers
  std::optional<PairCheck> pair;     // of some stereo pairs
  int late = 0;                      // inputs of this camera left out since the frame before
  int dropped = 0;                   // likewise, for want of time
  // What was taken out of the right image, see PairAlignment; null: nothing.
  std::shared_ptr<const PairAlignment> alignment{};
  bool alignment_changed = false;  // it is another one than the map says
};

// An input that will not be tracked.
struct LeftOut {
  CameraKind camera = CameraKind::kStereo;
  Nanoseconds time = 0;
  const char* reason = "";  // kDropped, or why it was not taken: to_string(PushResult)
};
inline constexpr const char* kDropped = "dropped";

// A frame of either camera, ready to be tracked.
struct CameraFrame {
  CameraKind camera = CameraKind::kStereo;
  Nanoseconds time = 0;
  Frame frame;
  FrameEvidence evidence{};
};

}  // namespace hybrid_slam
