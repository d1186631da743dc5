#include "apps/scene_renderer/dataset_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "apps/io/report.h"
#include "apps/io/trajectory.h"
#include "apps/scene_renderer/scene_json.h"
#include "cameras/files/input_error.h"
#include "cameras/files/output_file.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr int kJpegQuality = 95;

// From the scene's origin, which all cameras look at, poses would look alike whichever way they are
// read, as world_from_cam or the inverse: the dataset's world begins elsewhere.
Rigid3d in_world(const Rigid3d& scene_from_cam) {
  return {scene_from_cam.rotation(), scene_from_cam.translation() + Eigen::Vector3d(4, 7, -3)};
}

std::string ros_camera(const Calibrated<RectifiedStereo>& camera, const std::string& name,
                       double p3) {
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  return fmt::format(
      "image_width: {0}\nimage_height: {1}\ncamera_name: {2}\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n"
      "  data: [{3:.9f}, 0.0, {5:.9f}, 0.0, {4:.9f}, {6:.9f}, 0.0, 0.0, 1.0]\n"
      "distortion_model: plumb_bob\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.0, 0.0, 0.0, 0.0, 0.0]\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n"
      "  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]\n"
      "projection_matrix:\n  rows: 3\n  cols: 4\n"
      "  data: [{3:.9f}, 0.0, {5:.9f}, {7:.9f}, 0.0, {4:.9f}, {6:.9f}, 0.0, 0.0, 0.0, 1.0, 0.0]\n",
      camera.width, camera.height, name, fx, fy, cx, cy, p3);
}

std::string fisheye_file(const Calibrated<KannalaBrandt>& camera) {
  const auto& [fx, fy, cx, cy, k1, k2, k3, k4] = camera.params;
  return fmt::format(
      "%YAML:1.0\n---\n# Kannala-Brandt: theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 "
      "+ "
      "k4 theta^8)\n"
      "camera_model: pinhole\ndistortion_model: equidistant\n"
      "image_width: {}\nimage_height: {}\n"
      "fx: {:.9f}\nfy: {:.9f}\ncx: {:.9f}\ncy: {:.9f}\n"
      "k1: {:.9f}\nk2: {:.9f}\nk3: {:.9f}\nk4: {:.9f}\n",
      camera.width, camera.height, fx, fy, cx, cy, k1, k2, k3, k4);
}

void write_encoded(const fs::path& path, const cv::Mat& pixels, const std::vector<int>& settings) {
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(path.extension().string(), pixels, bytes, settings)) {
    throw std::logic_error("no encoder");
  }
  write_file(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

// Sequences beside each other share their calibration.
void write_shared(const fs::path& path, const std::string& content) {
  if (fs::exists(path) && read_file(path) != content) {
    throw InputError(path.string() +
                     ": sequences beside this one have other cameras; choose another folder");
  }
  write_file(path, content);
}

std::string pose_columns(const Rigid3d& pose) {
  const Eigen::Quaterniond q = pose.rotation();
  const Eigen::Vector3d t = pose.translation();
  return fmt::format(" {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}", t.x(), t.y(), t.z(),
                     q.w(), q.x(), q.y(), q.z());
}

}  // namespace

DatasetWriter::DatasetWriter(const fs::path& folder, const std::string& name, ImageFormat format,
                             const SceneOptions& options, const SceneCameras& cameras)
    : format_(format), hybrid_(options.kind == SceneKind::kHybrid) {
  names_ = hybrid_ ? std::array<std::string, 3>{"_left", "_right", "_fish"}
                   : std::array<std::string, 3>{"_0", "_1", ""};
  const fs::path parent = hybrid_ ? folder / "hybrid" : folder;
  sequence_ = parent / name;
  images_ = hybrid_ ? sequence_ / "images" / "raw" : sequence_ / "images";
  if (fs::exists(sequence_) && (!fs::is_directory(sequence_) || !fs::is_empty(sequence_))) {
    throw InputError(sequence_.string() +
                     ": is there already; choose another --sequence or remove it");
  }
  const fs::path calibration = make_folder((hybrid_ ? parent : sequence_) / "calibration");
  const auto& params = cameras.stereo.params;
  write_shared(calibration / "left_camera.yaml", ros_camera(cameras.stereo, "left_camera", 0));
  write_shared(calibration / "right_camera.yaml",
               ros_camera(cameras.stereo, "right_camera", -params[0] * params[4]));
  if (hybrid_) write_shared(calibration / "fisheye_calib.yaml", fisheye_file(cameras.fisheye));
  make_folder(images_);
}

void DatasetWriter::write_image(const std::string& name, const ColorImage& image) const {
  const cv::Mat pixels(image.height, image.width, CV_8UC3,
                       const_cast<std::uint8_t*>(image.pixels.data()));  // only read
  const bool jpeg = format_ == ImageFormat::kJpeg;
  const std::vector<int> settings =
      jpeg ? std::vector<int>{cv::IMWRITE_JPEG_QUALITY, kJpegQuality} : std::vector<int>{};
  write_encoded(images_ / (name + (jpeg ? ".jpg" : ".png")), pixels, settings);
}

void DatasetWriter::write_mask(const std::string& name, const ColorImage& image,
                               const std::vector<std::uint8_t>& arm) const {
  if (arm.empty()) return;
  cv::Mat mask(image.height, image.width, CV_8UC1);
  std::transform(arm.begin(), arm.end(), mask.data,
                 [](std::uint8_t seen) { return static_cast<std::uint8_t>(seen ? 0 : 255); });
  write_encoded(make_folder(sequence_ / "masks") / (name + ".png"), mask, {});
}

// What the port lets through, 255 where it is clean.
void DatasetWriter::write_dirt(const SceneSequence& sequence) const {
  const auto& [stereo, fisheye] = sequence.cameras();
  const auto write = [&](ViewNumber view, const std::string& name, int width, int height) {
    const std::vector<float>& dirt = sequence.dirt(view);
    if (dirt.empty()) return;
    cv::Mat port(height, width, CV_8UC1);
    std::transform(dirt.begin(), dirt.end(), port.data, [](float stopped) {
      return static_cast<std::uint8_t>(255 * (1 - stopped) + 0.5F);
    });
    write_encoded(make_folder(sequence_ / "masks") / ("port" + name + ".png"), port, {});
  };
  write(kLeft, names_[kLeft], stereo.width, stereo.height);
  write(kRight, names_[kRight], stereo.width, stereo.height);
  write(kFish, names_[kFish], fisheye.width, fisheye.height);
}

void DatasetWriter::write(int frame, const RenderedFrame& images) const {
  const auto write = [&](ViewNumber view, const ColorImage& image) {
    const std::string name = std::to_string(frame) + names_[view];
    write_image(name, image);
    write_mask(name, image, images.arm[view]);
  };
  write(kLeft, images.left);
  write(kRight, images.right);
  if (images.fish) write(kFish, *images.fish);
}

void DatasetWriter::finish(const SceneSequence& sequence) const {
  std::string times, poses;
  Trajectory left, fish;
  for (const RigMoment& moment : sequence.motion()) {
    const Rigid3d world_from_left = in_world(moment.world_from_left);
    times += fmt::format("{:.6f}\n", moment.time);
    left.push_back({moment.time, world_from_left});
    if (moment.world_from_fish) {
      const Rigid3d world_from_fish = in_world(*moment.world_from_fish);
      poses += std::to_string(fish.size()) + pose_columns(world_from_fish) +
               pose_columns(world_from_left) + "\n";
      fish.push_back({moment.time, world_from_fish});
    } else {
      const Eigen::Vector3d t = world_from_left.translation();
      poses += fmt::format("{:.6f} {:.9f} {:.9f} {:.9f}\n", moment.time, t.x(), t.y(), t.z());
    }
  }
  write_file(sequence_ / "times.txt", times);
  write_file(sequence_ / (hybrid_ ? "camera_poses.txt" : "gt_poses.txt"), poses);
  write_tum(sequence_ / "gt_left_tum.txt", left);
  if (hybrid_) write_tum(sequence_ / "gt_fish_tum.txt", fish);
  write_dirt(sequence);
  if (sequence.options().conditions.miscalibration != Miscalibration{}) {
    write_json(sequence_ / "true_cameras.json", true_cameras_json(sequence));
  }
  write_json(sequence_ / "scene.json", scene_json(sequence));
}

}  // namespace hybrid_slam
