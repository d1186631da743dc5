#include <cmath>
#include <cstdio>

#include "cameras/calibration/calibration_section.h"
#include "cameras/calibration/fisheye_fit.h"
#include "cameras/double_sphere.h"
#include "cameras/extended_unified.h"
#include "cameras/unified_radtan.h"

namespace hybrid_slam {
namespace {

constexpr double kMaxFitError = 5;  // [px]; beyond, features would land on other ones

struct Resolution {
  int width = 0;
  int height = 0;
};

Resolution read_resolution(const YamlSection& section) {
  const std::vector<double> size = section.numbers("resolution", 2);
  return {image_size(section, "resolution", size[0]), image_size(section, "resolution", size[1])};
}

// The lens in the model that images are tracked in, and by how much it misses.
template <ProjectionModel M>
FisheyeLens fitted(const Calibrated<M>& lens, const YamlSection& section, const std::string& key,
                   const char* model) {
  check_intrinsics(section, lens.params.data(), lens.width, lens.height, key);
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

FisheyeLens read_basalt_camera(const YamlSection& camera, Resolution size) {
  const std::string type = camera.text("camera_type");
  const YamlSection k = camera.child("intrinsics");
  const auto value = [&](const char* key) { return k.number(key); };
  const double fx = value("fx"), fy = value("fy"), cx = value("cx"), cy = value("cy");
  if (type == "ds") {
    return fitted<DoubleSphere>(
        {{fx, fy, cx, cy, value("xi"), value("alpha")}, size.width, size.height}, camera,
        "intrinsics", "double sphere");
  }
  if (type == "eucm") {
    return fitted<ExtendedUnified>(
        {{fx, fy, cx, cy, value("alpha"), value("beta")}, size.width, size.height}, camera,
        "intrinsics", "extended unified");
  }
  const Calibrated<KannalaBrandt> lens{
      {fx, fy, cx, cy, value("k1"), value("k2"), value("k3"), value("k4")},
      size.width,
      size.height};
  check_intrinsics(camera, lens.params.data(), size.width, size.height, "intrinsics");
  return {lens, ""};
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

FisheyeLens read_basalt_lens(const YamlSection& file) {
  const YamlSection value = file.child("value0");
  const std::vector<YamlSection> cameras = value.children("intrinsics");
  const auto sizes = value.rows("resolution", cameras.size(), 2);
  std::optional<FisheyeLens> found;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const std::string type = cameras[i].text("camera_type");
    if (type != "kb4" && type != "ds" && type != "eucm") continue;
    if (found) value.fail("intrinsics", "hold a second fisheye, and one is expected");
    found = read_basalt_camera(cameras[i], {image_size(value, "resolution", sizes[i][0]),
                                            image_size(value, "resolution", sizes[i][1])});
  }
  if (!found) value.fail("intrinsics", "no camera_type is that of a fisheye (kb4, ds, eucm)");
  return *found;
}

}  // namespace hybrid_slam
