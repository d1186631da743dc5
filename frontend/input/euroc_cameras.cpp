#include "frontend/input/euroc_cameras.h"

#include <algorithm>
#include <span>

#include "cameras/calibration/basalt_file.h"
#include "cameras/calibration/calibration_file.h"
#include "cameras/files/yaml_section.h"
#include "frontend/input/file_sequence.h"
#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

bool is_one_of(const std::string& name, std::initializer_list<const char*> names) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// The distortion by any of its names.
void read_distortion(const YamlSection& file, RawCamera& camera) {
  const std::string model = file.text("distortion_model");
  camera.is_fisheye =
      is_one_of(model, {"equidistant", "fisheye", "kannala-brandt", "kannala_brandt"});
  const bool is_radial = is_one_of(model, {"radial-tangential", "radtan", "plumb_bob", "radtan5",
                                           "radtan8", "rational", "rational_polynomial"});
  if (model == "none") {
    camera.distortion.assign(4, 0.0);
    return;
  }
  if (!camera.is_fisheye && !is_radial) {
    file.fail("distortion_model",
              "'" + model +
                  "' is not supported (radial-tangential, plumb_bob, rational, equidistant, none "
                  "are)");
  }
  camera.distortion = file.numbers("distortion_coefficients");
  const std::size_t count = camera.distortion.size();
  if (camera.is_fisheye ? count != 4 : count != 4 && count != 5 && count != 8) {
    file.fail("distortion_coefficients",
              camera.is_fisheye ? "must have 4 numbers" : "must have 4, 5 or 8 numbers");
  }
}

// The first by name; empty if there is none.
fs::path find_camchain(const fs::path& folder, const fs::path& mav) {
  for (const fs::path& place : {folder / "dso", folder, mav}) {
    if (!fs::is_directory(place)) continue;
    std::vector<fs::path> found;
    for (const fs::directory_entry& entry : fs::directory_iterator(place)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with("camchain") && name.ends_with(".yaml")) found.push_back(entry.path());
    }
    if (!found.empty()) return *std::min_element(found.begin(), found.end());
  }
  return {};
}

// `distortion`: of a Pinhole.
RawCamera raw_camera(const Camera& camera, std::span<const double> distortion) {
  RawCamera raw;
  raw.size = {image_width(camera), image_height(camera)};
  const auto take = [&](const auto& params) {
    raw.fx = params[0], raw.fy = params[1], raw.cx = params[2], raw.cy = params[3];
  };
  if (const auto* fisheye = std::get_if<Calibrated<KannalaBrandt>>(&camera)) {
    take(fisheye->params);
    raw.is_fisheye = true;
    raw.distortion.assign(fisheye->params.begin() + 4, fisheye->params.end());
  } else {
    take(std::get<Calibrated<Pinhole>>(camera).params);
    raw.distortion.assign(distortion.begin(), distortion.end());
    if (raw.distortion.empty()) raw.distortion.assign(4, 0.0);
  }
  return raw;
}

}  // namespace

EurocCamera read_euroc_sensor(const fs::path& path) {
  const YamlSection file = YamlSection::read(path.string());
  if (file.text("camera_model") != "pinhole")
    file.fail("camera_model", "only pinhole is supported");
  EurocCamera result;
  result.source = path.string();
  RawCamera& camera = result.camera;
  read_distortion(file, camera);
  const std::vector<double> f_and_c = file.numbers("intrinsics", 4);
  const std::vector<double> size = file.numbers("resolution", 2);
  const std::vector<double> pose = file.child("T_BS").numbers("data", 16);
  for (const double side : size) {
    if (!(side >= 1 && side <= 65536)) file.fail("resolution", "impossible");
  }
  camera.size = {static_cast<int>(size[0]), static_cast<int>(size[1])};
  const auto checked = make_stereo_camera(f_and_c[0], f_and_c[1], f_and_c[2], f_and_c[3], 1,
                                          camera.size, path.string() + ": intrinsics");
  camera.fx = checked.params[0];
  camera.fy = checked.params[1];
  camera.cx = checked.params[2];
  camera.cy = checked.params[3];
  NumberRow row{file.line("T_BS"), {pose.begin(), pose.begin() + 12}};
  result.body_from_cam = kitti_pose(row, path);
  return result;
}

std::array<EurocCamera, 2> read_camchain_pair(const fs::path& path) {
  const std::vector<KalibrCamera> chain = read_kalibr_camchain(path.string());
  if (chain.size() < 2) throw InputError(path.string() + ": cam1: is missing");
  if (!chain[1].camera_from_previous) {
    throw InputError(path.string() + ": cam1.T_cn_cnm1: is missing");
  }
  std::array<EurocCamera, 2> cameras;
  for (std::size_t i = 0; i < 2; ++i) {
    cameras[i].camera = raw_camera(chain[i].camera, chain[i].radtan);
    cameras[i].source = path.string();
    cameras[i].note = chain[i].note.empty() ? "" : chain[i].name + ": " + chain[i].note;
  }
  if (chain[0].camera_from_imu) cameras[0].body_from_cam = inverse(*chain[0].camera_from_imu);
  cameras[1].body_from_cam = cameras[0].body_from_cam * inverse(*chain[1].camera_from_previous);
  return cameras;
}

std::array<EurocCamera, 2> read_basalt_pair(const fs::path& path) {
  const std::vector<BasaltCamera> all = read_basalt_cameras(path.string());
  if (all.size() < 2)
    throw InputError(path.string() + ": value0: has one camera, and a pair has two");
  std::array<EurocCamera, 2> cameras;
  for (std::size_t i = 0; i < 2; ++i) {
    cameras[i] = {raw_camera(all[i].camera, all[i].distortion), all[i].imu_from_camera,
                  path.string(), all[i].note};
  }
  return cameras;
}

std::array<EurocCamera, 2> read_euroc_cameras(const fs::path& folder, const fs::path& mav) {
  const fs::path left = mav / "cam0" / "sensor.yaml";
  if (!fs::exists(left)) {
    const fs::path chain = find_camchain(folder, mav);
    if (!chain.empty()) return read_camchain_pair(chain);
  }
  return {read_euroc_sensor(left), read_euroc_sensor(mav / "cam1" / "sensor.yaml")};
}

}  // namespace hybrid_slam
