#include "cameras/calibration/calibration_section.h"
#include "cameras/calibration/fitted_lens.h"
#include "cameras/double_sphere.h"
#include "cameras/extended_unified.h"
#include "cameras/unified_radtan.h"

namespace hybrid_slam {
namespace {

struct Resolution {
  int width = 0;
  int height = 0;
};

Resolution read_resolution(const YamlSection& section) {
  const std::vector<double> size = section.numbers("resolution", 2);
  return {image_size(section, "resolution", size[0]), image_size(section, "resolution", size[1])};
}

void require_no_distortion(const YamlSection& section) {
  if (section.has("distortion_model") && section.text("distortion_model") != "none") {
    section.fail("distortion_model", "must be none with this camera_model");
  }
}

FisheyeLens read_omni(const YamlSection& section, Resolution size) {
  const std::vector<double> k = section.numbers("intrinsics", 5);  // xi, fu, fv, pu, pv
  std::vector<double> d(4, 0.0);
  const std::string distortion = section.text("distortion_model");
  if (distortion == "radtan") {
    d = section.numbers("distortion_coeffs", 4);
  } else if (distortion != "none") {
    section.fail("distortion_model",
                 "'" + distortion + "' is not supported with omni (radtan, none are)");
  }
  const Calibrated<UnifiedRadtan> lens{
      {k[1], k[2], k[3], k[4], k[0], d[0], d[1], d[2], d[3]}, size.width, size.height};
  return fitted(lens, section, "intrinsics", "omni");
}

}  // namespace

std::optional<FisheyeLens> read_kalibr_lens(const YamlSection& section) {
  const std::string model = section.has("camera_model") ? section.text("camera_model") : "pinhole";
  const Resolution size = read_resolution(section);
  if (model == "ds") {
    require_no_distortion(section);
    const std::vector<double> k = section.numbers("intrinsics", 6);  // xi, alpha, fu, fv, pu, pv
    return fitted<DoubleSphere>({{k[2], k[3], k[4], k[5], k[0], k[1]}, size.width, size.height},
                                section, "intrinsics", "double sphere");
  }
  if (model == "eucm") {
    require_no_distortion(section);
    const std::vector<double> k = section.numbers("intrinsics", 6);  // alpha, beta, fu, fv, pu, pv
    return fitted<ExtendedUnified>({{k[2], k[3], k[4], k[5], k[0], k[1]}, size.width, size.height},
                                   section, "intrinsics", "extended unified");
  }
  if (model == "omni") return read_omni(section, size);
  if (model != "pinhole") {
    section.fail("camera_model", "'" + model + "' is not supported (pinhole, ds, eucm, omni are)");
  }
  if (section.has("distortion_model") && section.text("distortion_model") != "equidistant") {
    return std::nullopt;
  }
  const std::vector<double> k = section.numbers("intrinsics", 4);
  const std::vector<double> d = section.numbers("distortion_coeffs", 4);
  check_intrinsics(section, k.data(), size.width, size.height, "intrinsics");
  return FisheyeLens{{{k[0], k[1], k[2], k[3], d[0], d[1], d[2], d[3]}, size.width, size.height},
                     ""};
}

}  // namespace hybrid_slam
