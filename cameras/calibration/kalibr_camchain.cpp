#include <algorithm>

#include <Eigen/LU>

#include "cameras/calibration/calibration_file.h"
#include "cameras/calibration/calibration_section.h"

namespace hybrid_slam {
namespace {

// A rigid transform of 4x4 numbers.
Rigid3d read_transform(const YamlSection& section, const std::string& key) {
  const auto rows = section.rows(key, 4, 4);
  Eigen::Matrix4d t;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) t(r, c) = rows[std::size_t(r)][std::size_t(c)];
  }
  const Eigen::Matrix3d rotation = t.topLeftCorner<3, 3>();
  constexpr double kTolerance = 1e-4;  // files are written with few digits
  if ((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm() > kTolerance ||
      rotation.determinant() < 0 || t.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) {
    section.fail(key, "is no rigid transform");
  }
  return {Eigen::Quaterniond(rotation), t.topRightCorner<3, 1>()};
}

// A camera that is no fisheye: pinhole with radtan distortion or none.
void read_pinhole(const YamlSection& section, KalibrCamera& result) {
  const std::vector<double> k = section.numbers("intrinsics", 4);
  const std::vector<double> resolution = section.numbers("resolution", 2);
  const int width = image_size(section, "resolution", resolution[0]);
  const int height = image_size(section, "resolution", resolution[1]);
  check_intrinsics(section, k.data(), width, height, "intrinsics");
  const std::string distortion = section.text("distortion_model");
  if (distortion != "radtan" && distortion != "none") {
    section.fail("distortion_model",
                 "'" + distortion + "' is not supported (equidistant, radtan, none are)");
  }
  result.camera = Calibrated<Pinhole>{{k[0], k[1], k[2], k[3]}, width, height};
  if (distortion == "none") return;
  const std::vector<double> d = section.numbers("distortion_coeffs", 4);
  std::copy(d.begin(), d.end(), result.radtan.begin());
}

KalibrCamera read_kalibr_camera(const YamlSection& chain, const std::string& name) {
  const YamlSection section = chain.child(name);
  KalibrCamera result;
  result.name = name;
  section.text("camera_model");      // must be there
  section.text("distortion_model");  // likewise
  if (const auto lens = read_kalibr_lens(section)) {
    result.camera = lens->camera;
    result.note = lens->note;
  } else {
    read_pinhole(section, result);
  }
  if (section.has("T_cn_cnm1")) result.camera_from_previous = read_transform(section, "T_cn_cnm1");
  if (section.has("T_cam_imu")) result.camera_from_imu = read_transform(section, "T_cam_imu");
  return result;
}

std::vector<KalibrCamera> read_kalibr_cameras(const YamlSection& chain) {
  std::vector<KalibrCamera> cameras;
  for (int i = 0; chain.has("cam" + std::to_string(i)); ++i) {
    cameras.push_back(read_kalibr_camera(chain, "cam" + std::to_string(i)));
  }
  if (cameras.empty()) chain.fail("cam0", "is missing");
  return cameras;
}

}  // namespace

std::vector<KalibrCamera> read_kalibr_camchain(const std::string& path) {
  return read_kalibr_cameras(YamlSection::read(path));
}

FisheyeLens read_chain_fisheye(const YamlSection& chain, std::vector<std::string>& notes) {
  std::vector<KalibrCamera> cameras = read_kalibr_cameras(chain);
  std::erase_if(cameras, [](const KalibrCamera& camera) {
    return !std::holds_alternative<Calibrated<KannalaBrandt>>(camera.camera);
  });
  if (cameras.empty()) {
    chain.fail("cam0", "no camera of this chain is a fisheye (pinhole, equidistant)");
  }
  std::stable_partition(cameras.begin(), cameras.end(),
                        [](const KalibrCamera& camera) { return camera.note.empty(); });
  const bool same_kind = cameras.size() > 1 && cameras[0].note.empty() == cameras[1].note.empty();
  if (same_kind) chain.fail(cameras[1].name, "is a second fisheye, and one is expected");
  if (cameras.size() > 1) {
    notes.push_back("both " + cameras[0].name + " and " + cameras[1].name +
                    " could be the fisheye; took " + cameras[0].name + ", which is equidistant");
  }
  return {std::get<Calibrated<KannalaBrandt>>(cameras[0].camera), cameras[0].note};
}

}  // namespace hybrid_slam
