#include "test/integration/simulated_source.h"

#include <string>
#include <utility>

#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

Frame without_features(const Frame& frame) {
  StereoFeatures none;
  none.left.kind = none.right.kind = frame.features.left.kind;
  return make_frame(frame.index, frame.time, std::move(none), 64, 64);
}

}  // namespace

CameraRig SimulatedSource::cameras() const {
  CameraRig cameras{std::get<Calibrated<RectifiedStereo>>(scene_.cameras.front()), std::nullopt};
  if (scene_.cameras.size() > 1) {
    cameras.fisheye = std::get<Calibrated<KannalaBrandt>>(scene_.cameras[1]);
  }
  return cameras;
}

Nanoseconds SimulatedSource::time(std::size_t index) const {
  return to_nanoseconds(order.empty() ? stereo_truth(index).observations->time
                                      : static_cast<double>(index) / scene_.options.frame_rate);
}

ExtractedFrame SimulatedSource::extracted(CameraKind camera, std::size_t index, Frame frame) const {
  return {time(index), camera, std::move(frame)};
}

Moment SimulatedSource::read(std::size_t index) const {
  Moment made;
  if (corrupt.contains(index)) {
    made.error = "frame " + std::to_string(index) + ": made unreadable by the test";
    return made;
  }
  const CameraRig rig = cameras();
  Frame stereo = stereo_frame(stereo_truth(index), rig.stereo);
  if (blank.contains(index)) stereo = without_features(stereo);
  made.inputs.push_back(extracted(CameraKind::kStereo, index, std::move(stereo)));
  if (fisheye_missing.contains(index)) {
    made.fisheye_error = "frame " + std::to_string(index) + ": no fisheye image";
  } else if (rig.fisheye) {
    Frame fisheye = mono_frame(fisheye_truth(index), *rig.fisheye);
    if (fisheye_blank.contains(index)) fisheye = without_features(fisheye);
    made.inputs.push_back(extracted(CameraKind::kFisheye, index, std::move(fisheye)));
  }
  return made;
}

}  // namespace hybrid_slam
