#include "apps/map_tool/nerfstudio_export.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/io/ply.h"
#include "apps/io/report.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kImageCorner = 0.5;  // the origin is the image's corner

struct Lens {
  const char* model = "OPENCV";
  Json numbers;
};

template <typename C>
Lens lens_of(const C& camera) {
  using M = typename C::Model;
  if constexpr (std::is_same_v<M, Pinhole> || std::is_same_v<M, RectifiedStereo> ||
                std::is_same_v<M, KannalaBrandt>) {
    const auto& p = camera.params;
    Lens lens;
    lens.numbers = {{"fl_x", p[0]},
                    {"fl_y", p[1]},
                    {"cx", p[2] + kImageCorner},
                    {"cy", p[3] + kImageCorner},
                    {"w", camera.width},
                    {"h", camera.height}};
    if constexpr (std::is_same_v<M, KannalaBrandt>) {
      lens.model = "OPENCV_FISHEYE";
      lens.numbers.update({{"k1", p[4]}, {"k2", p[5]}, {"k3", p[6]}, {"k4", p[7]}});
    }
    return lens;
  } else {
    throw InputError(
        fmt::format("a camera of the model {} cannot be exported to nerfstudio", M::kName));
  }
}

// x right, y up, z backwards.
Json transform_matrix(const Rigid3d& cam_from_world) {
  Eigen::Matrix4d world_from_cam = Eigen::Matrix4d::Identity();
  const Rigid3d pose = inverse(cam_from_world);
  world_from_cam.topLeftCorner<3, 3>() = pose.rotation().toRotationMatrix();
  world_from_cam.topRightCorner<3, 1>() = pose.translation();
  world_from_cam.col(1) *= -1;
  world_from_cam.col(2) *= -1;
  Json rows = Json::array();
  for (int row = 0; row < 4; ++row) {
    rows.push_back({world_from_cam(row, 0), world_from_cam(row, 1), world_from_cam(row, 2),
                    world_from_cam(row, 3)});
  }
  return rows;
}

class NerfstudioExport {
 public:
  NerfstudioExport(const MapSnapshot& map, const ImageNames& names, fs::path images,
                   fs::path folder)
      : map_(map), names_(names), images_(std::move(images)), folder_(std::move(folder)) {}

  void add(const Keyframe& keyframe) {
    const double to_right = baseline(map_.camera(keyframe));
    const Rigid3d& left = keyframe.cam_from_world;
    add_image(keyframe, to_right > 0 ? ImageSide::kLeft : ImageSide::kSingle, left);
    if (!(to_right > 0)) return;
    const Rigid3d right_from_left(Eigen::Quaterniond::Identity(), Eigen::Vector3d(-to_right, 0, 0));
    add_image(keyframe, ImageSide::kRight, right_from_left * left);
  }

  void write() const {
    for (const auto& [model, frames] : frames_) {
      const bool fisheye = model != "OPENCV";
      write_json(folder_ / (fisheye ? "transforms_fisheye.json" : "transforms.json"),
                 {{"camera_model", model}, {"frames", frames}, {"ply_file_path", "points.ply"}});
    }
  }

 private:
  void add_image(const Keyframe& keyframe, ImageSide side, const Rigid3d& cam_from_world) {
    const Lens lens =
        std::visit([](const auto& one) { return lens_of(one); }, map_.camera(keyframe));
    const auto file = names_.file(keyframe, side);
    const fs::path path = file ? *file : images_ / names_.name(keyframe, side);
    const fs::path relative = fs::absolute(path).lexically_normal().lexically_relative(
        fs::absolute(folder_).lexically_normal());
    Json frame = {{"file_path", relative.generic_string()},
                  {"transform_matrix", transform_matrix(cam_from_world)}};
    frame.update(lens.numbers);
    frames_[lens.model].push_back(std::move(frame));
  }

  const MapSnapshot& map_;
  const ImageNames& names_;
  fs::path images_, folder_;
  std::map<std::string, Json> frames_;  // by camera model
};

}  // namespace

void export_nerfstudio(const MapSnapshot& map, KeyframeId component, const ImageNames& names,
                       const fs::path& images, const fs::path& folder) {
  NerfstudioExport out(map, names, images, folder);
  for (const KeyframeId id : map.keyframe_ids()) {
    if (map.at(id).component == component) out.add(map.at(id));
  }
  std::vector<ColoredPoint> points;
  for (const LandmarkId id : map.landmark_ids()) {
    if (map.at(map.at(id).reference).component != component) continue;
    points.push_back({map.at(id).point_in_world, {128, 128, 128}});
  }
  write_ply(make_folder(folder) / "points.ply", points);
  out.write();
}

}  // namespace hybrid_slam
