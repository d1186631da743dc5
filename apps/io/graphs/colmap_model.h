#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cameras/files/input_error.h"
#include "cameras/geometry/rigid3d.h"

namespace hybrid_slam {

// A COLMAP model as its files have it: their order, their ids, their pixels (the corner of the
// image is the origin). `place` is where an item was read: its line, or its first byte in a binary
// file.

enum class ColmapVariant { kText, kBinary };

enum class ColmapCameraModel : std::int32_t {
  kSimplePinhole = 0,        // f, cx, cy
  kPinhole = 1,              // fx, fy, cx, cy
  kSimpleRadial = 2,         // f, cx, cy, k
  kRadial = 3,               // f, cx, cy, k1, k2
  kOpencv = 4,               // fx, fy, cx, cy, k1, k2, p1, p2
  kOpencvFisheye = 5,        // fx, fy, cx, cy, k1, k2, k3, k4
  kFullOpencv = 6,           // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6
  kFov = 7,                  // fx, fy, cx, cy, omega
  kSimpleRadialFisheye = 8,  // f, cx, cy, k
  kRadialFisheye = 9,        // f, cx, cy, k1, k2
  kThinPrismFisheye = 10,    // fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, sx1, sy1
  kRadTanThinPrism = 11,     // 16: carried along where no image uses it
};

struct ColmapCameraKind {
  ColmapCameraModel model = ColmapCameraModel::kPinhole;
  std::string_view name;
  std::size_t params = 0;
};

inline constexpr std::array<ColmapCameraKind, 12> kColmapCameraKinds{
    {{ColmapCameraModel::kSimplePinhole, "SIMPLE_PINHOLE", 3},
     {ColmapCameraModel::kPinhole, "PINHOLE", 4},
     {ColmapCameraModel::kSimpleRadial, "SIMPLE_RADIAL", 4},
     {ColmapCameraModel::kRadial, "RADIAL", 5},
     {ColmapCameraModel::kOpencv, "OPENCV", 8},
     {ColmapCameraModel::kOpencvFisheye, "OPENCV_FISHEYE", 8},
     {ColmapCameraModel::kFullOpencv, "FULL_OPENCV", 12},
     {ColmapCameraModel::kFov, "FOV", 5},
     {ColmapCameraModel::kSimpleRadialFisheye, "SIMPLE_RADIAL_FISHEYE", 4},
     {ColmapCameraModel::kRadialFisheye, "RADIAL_FISHEYE", 5},
     {ColmapCameraModel::kThinPrismFisheye, "THIN_PRISM_FISHEYE", 12},
     {ColmapCameraModel::kRadTanThinPrism, "RAD_TAN_THIN_PRISM_FISHEYE", 16}}};

struct ColmapCamera {
  std::uint32_t id = 0;
  ColmapCameraKind kind;
  std::uint64_t width = 0, height = 0;
  std::vector<double> params;
  std::uint64_t place = 0;
};

struct ColmapPoint2d {
  static constexpr std::uint64_t kNoPoint = UINT64_MAX;

  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  std::uint64_t point = kNoPoint;  // id
};

struct ColmapImage {
  std::uint32_t id = 0;
  Rigid3d cam_from_world;
  std::uint32_t camera = 0;  // id
  std::string name;
  std::vector<ColmapPoint2d> points;
  std::uint64_t place = 0;
};

struct ColmapTrackElement {
  std::uint32_t image = 0;  // id
  std::uint32_t point = 0;  // index into the image's points
};

struct ColmapPoint {
  std::uint64_t id = 0;
  Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
  std::array<std::uint8_t, 3> color{};
  double error = -1;  // mean distance in the images [px]; -1: not known
  std::vector<ColmapTrackElement> track;
  std::uint64_t place = 0;
};

struct ColmapSensor {
  static constexpr std::int32_t kCamera = 0;
  static constexpr std::int32_t kImu = 1;

  std::int32_t type = kCamera;
  std::uint32_t id = 0;
  bool operator==(const ColmapSensor&) const = default;
};

struct ColmapRigSensor {
  ColmapSensor sensor;
  std::optional<Rigid3d> sensor_from_rig;
};

struct ColmapRig {
  std::uint32_t id = 0;
  std::optional<ColmapSensor> reference;
  std::vector<ColmapRigSensor> others;
  std::uint64_t place = 0;
};

struct ColmapFrameData {
  ColmapSensor sensor;
  std::uint64_t id = 0;  // an image, for a camera
};

struct ColmapFrame {
  std::uint32_t id = 0;
  std::uint32_t rig = 0;  // id
  Rigid3d rig_from_world;
  std::vector<ColmapFrameData> data;
  std::uint64_t place = 0;
};

struct ColmapModel {
  std::filesystem::path folder;
  ColmapVariant variant = ColmapVariant::kText;
  std::vector<ColmapCamera> cameras;
  std::vector<ColmapImage> images;
  std::vector<ColmapPoint> points;
  bool has_rigs = false;  // files of rigs and frames; older versions have none
  std::vector<ColmapRig> rigs;
  std::vector<ColmapFrame> frames;

  // The file of "cameras", "images", "points3D", "rigs" or "frames".
  std::filesystem::path file(std::string_view name) const;

  // A complaint about an item of such a file.
  InputError error(std::string_view name, std::uint64_t place, std::string_view reason) const;
};

// Whether a folder holds a model in this variant.
bool has_colmap_model(const std::filesystem::path& folder, ColmapVariant variant);

// Removes the model's files, in both variants.
void remove_colmap_model(const std::filesystem::path& folder);

// Throw InputError if a file is missing, malformed, holds numbers that are not finite, or a camera
// that is not supported. Whether ids are unique and refer to something is not looked at.
ColmapModel read_colmap_text(const std::filesystem::path& folder);
ColmapModel read_colmap_binary(const std::filesystem::path& folder);

// Into a folder that is there. Throw OutputError.
void write_colmap_text(const std::filesystem::path& folder, const ColmapModel& model);
void write_colmap_binary(const std::filesystem::path& folder, const ColmapModel& model);

}  // namespace hybrid_slam
