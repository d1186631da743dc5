#include "cameras/calibration/basalt_file.h"

#include <cmath>

#include "cameras/calibration/calibration_section.h"
#include "cameras/calibration/fitted_lens.h"
#include "cameras/double_sphere.h"
#include "cameras/extended_unified.h"

namespace hybrid_slam {
namespace {

struct ImageExtent {
  int width = 0;
  int height = 0;
};

// What the file says of one camera.
struct BasaltEntry {
  YamlSection section;
  std::string type;
  ImageExtent size;
};

std::vector<BasaltEntry> read_entries(const YamlSection& value) {
  const std::vector<YamlSection> cameras = value.children("intrinsics");
  const auto sizes = value.rows("resolution", cameras.size(), 2);
  std::vector<BasaltEntry> entries;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    entries.push_back({cameras[i],
                       cameras[i].text("camera_type"),
                       {image_size(value, "resolution", sizes[i][0]),
                        image_size(value, "resolution", sizes[i][1])}});
  }
  return entries;
}

bool is_fisheye(const BasaltEntry& entry) {
  return entry.type == "kb4" || entry.type == "ds" || entry.type == "eucm";
}

FisheyeLens read_lens(const BasaltEntry& entry) {
  const auto& [width, height] = entry.size;
  const YamlSection k = entry.section.child("intrinsics");
  const auto value = [&](const char* key) { return k.number(key); };
  const double fx = value("fx"), fy = value("fy"), cx = value("cx"), cy = value("cy");
  if (entry.type == "ds") {
    return fitted<DoubleSphere>({{fx, fy, cx, cy, value("xi"), value("alpha")}, width, height},
                                entry.section, "intrinsics", "double sphere");
  }
  if (entry.type == "eucm") {
    return fitted<ExtendedUnified>({{fx, fy, cx, cy, value("alpha"), value("beta")}, width, height},
                                   entry.section, "intrinsics", "extended unified");
  }
  const Calibrated<KannalaBrandt> lens{
      {fx, fy, cx, cy, value("k1"), value("k2"), value("k3"), value("k4")}, width, height};
  check_intrinsics(entry.section, lens.params.data(), width, height, "intrinsics");
  return {lens, ""};
}

void read_pinhole(const BasaltEntry& entry, BasaltCamera& result) {
  const auto& [width, height] = entry.size;
  const YamlSection k = entry.section.child("intrinsics");
  const Calibrated<Pinhole> pinhole{
      {k.number("fx"), k.number("fy"), k.number("cx"), k.number("cy")}, width, height};
  check_intrinsics(entry.section, pinhole.params.data(), width, height, "intrinsics");
  result.camera = pinhole;
  if (entry.type == "pinhole") return;
  for (const char* const key : {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}) {
    result.distortion.push_back(k.number(key));
  }
}

Rigid3d read_pose(const YamlSection& pose) {
  const Eigen::Quaterniond rotation(pose.number("qw"), pose.number("qx"), pose.number("qy"),
                                    pose.number("qz"));
  constexpr double kTolerance = 1e-3;  // files are written with few digits
  if (!(std::abs(rotation.norm() - 1) < kTolerance))
    pose.fail("qw", "the quaternion is not of unit length");
  return {rotation.normalized(), {pose.number("px"), pose.number("py"), pose.number("pz")}};
}

}  // namespace

std::vector<BasaltCamera> read_basalt_cameras(const std::string& path) {
  const YamlSection value = YamlSection::read(path).child("value0");
  const std::vector<BasaltEntry> entries = read_entries(value);
  const std::vector<YamlSection> poses = value.children("T_imu_cam");
  if (poses.size() != entries.size()) {
    value.fail("T_imu_cam", "must have one pose for each of the intrinsics");
  }
  std::vector<BasaltCamera> cameras;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const BasaltEntry& entry = entries[i];
    BasaltCamera camera;
    if (is_fisheye(entry)) {
      const FisheyeLens lens = read_lens(entry);
      camera.camera = lens.camera;
      camera.note = lens.note;
    } else if (entry.type == "pinhole" || entry.type == "pinhole-radtan8") {
      read_pinhole(entry, camera);
    } else {
      entry.section.fail(
          "camera_type",
          "'" + entry.type + "' is not supported (kb4, ds, eucm, pinhole, pinhole-radtan8 are)");
    }
    camera.imu_from_camera = read_pose(poses[i]);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

FisheyeLens read_basalt_lens(const YamlSection& file) {
  const YamlSection value = file.child("value0");
  std::optional<FisheyeLens> found;
  for (const BasaltEntry& entry : read_entries(value)) {
    if (!is_fisheye(entry)) continue;
    if (found) value.fail("intrinsics", "hold a second fisheye, and one is expected");
    found = read_lens(entry);
  }
  if (!found) value.fail("intrinsics", "no camera_type is that of a fisheye (kb4, ds, eucm)");
  return *found;
}

}  // namespace hybrid_slam
