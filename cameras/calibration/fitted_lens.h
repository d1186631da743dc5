#pragma once

#include <cstdio>
#include <string>

#include "cameras/calibration/calibration_section.h"
#include "cameras/calibration/fisheye_fit.h"

namespace hybrid_slam {

// The lens in the model that images are tracked in, and by how much it misses: `key` and `model`
// name it in messages. Throws InputError where that is too much.
template <ProjectionModel M>
FisheyeLens fitted(const Calibrated<M>& lens, const YamlSection& section, const std::string& key,
                   const char* model) {
  check_intrinsics(section, lens.params.data(), lens.width, lens.height, key);
  constexpr double kMaxFitError = 5;  // [px]; beyond, features would land on other ones
  const FisheyeFit fit = fit_kannala_brandt(lens);
  if (!(fit.max_px < kMaxFitError)) {
    section.fail(key, std::string(model) + " is no fisheye that Kannala-Brandt comes close to");
  }
  char note[160];
  std::snprintf(note, sizeof(note),
                "%s, taken as Kannala-Brandt: %.2g px off on average, %.2g at most", model,
                fit.rms_px, fit.max_px);
  return {fit.camera, note};
}

}  // namespace hybrid_slam
