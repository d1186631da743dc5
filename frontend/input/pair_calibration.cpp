#include "frontend/input/pair_calibration.h"

namespace hybrid_slam {

void take_rectified_pair(const PairCalibration& pair, SequenceInfo& info) {
  const auto& [fx, fy, cx, cy, baseline] = pair.rectified.value().params;
  info.stereo = make_stereo_camera(fx, fy, cx, cy, baseline,
                                   {pair.rectified->width, pair.rectified->height}, pair.source);
}

std::unique_ptr<const StereoRectifier> take_raw_pair(const PairCalibration& pair,
                                                     SequenceInfo& info) {
  const RawPair& raw = pair.raw.value();
  info.warnings.insert(info.warnings.end(), pair.notes.begin(), pair.notes.end());
  auto rectifier = std::make_unique<const StereoRectifier>(raw.left, raw.right, raw.right_from_left,
                                                           pair.source);
  if (!rectifier->note().empty()) info.warnings.push_back(rectifier->note());
  info.stereo =
      make_stereo_camera(rectifier->focal_length(), rectifier->focal_length(), rectifier->cx(),
                         rectifier->cy(), rectifier->baseline(), raw.left.size, pair.source);
  return rectifier;
}

}  // namespace hybrid_slam
