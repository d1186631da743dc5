#include "test/apps/rendered_survey.h"

#include <array>
#include <cmath>
#include <stdexcept>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>

#include "test/support/temp_folder.h"
#include "test/support/textured_ground.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

using Images = std::array<std::string, 3>;  // left, right and fisheye, as PNG files

std::string encode_png(GrayImage image) {
  const cv::Mat pixels(image.height, image.width, CV_8UC1, image.pixels.data());
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(".png", pixels, bytes)) throw std::runtime_error("no PNG encoder");
  return {bytes.begin(), bytes.end()};
}

// As through a lens that shows no more than 86 degrees to the axis.
GrayImage render_fisheye(const TexturedGround& ground, const Rigid3d& world_from_fish) {
  const Camera camera = survey_fisheye();
  GrayImage image = ground.render(camera, world_from_fish);
  for (int v = 0; v < image.height; ++v) {
    for (int u = 0; u < image.width; ++u) {
      const auto ray = unproject(camera, Eigen::Vector2d(u, v));
      if (!ray || ray->z() < std::cos(1.5)) image.row(v)[u] = 4;
    }
  }
  return image;
}

// Rendered once per process.
const std::vector<Images>& survey_images() {
  static const std::vector<Images> images = [] {
    const TexturedGround ground = TexturedGround::with_steps();
    const Rigid3d left_from_right(Eigen::Quaterniond::Identity(),
                                  Eigen::Vector3d(baseline(survey_camera()), 0, 0));
    std::vector<Images> frames;
    for (int i = 0; i < kSurveyFrames; ++i) {
      frames.push_back(
          {encode_png(ground.render(survey_camera(), survey_pose(i))),
           encode_png(ground.render(survey_camera(), survey_pose(i) * left_from_right)),
           encode_png(render_fisheye(ground, survey_fisheye_pose(i)))});
    }
    return frames;
  }();
  return images;
}

int there_and_back(int frame) {
  const int turn = kSurveyFrames - 1;
  const int phase = frame % (2 * turn);
  return phase <= turn ? phase : 2 * turn - phase;
}

std::string matrix_row(const Rigid3d& pose) {
  const Eigen::Matrix3d r = pose.rotation().toRotationMatrix();
  const Eigen::Vector3d t = pose.translation();
  std::string row;
  for (int i = 0; i < 3; ++i) {
    row += fmt::format("{}{:.12f} {:.12f} {:.12f} {:.12f}", i == 0 ? "" : " ", r(i, 0), r(i, 1),
                       r(i, 2), t(i));
  }
  return row + "\n";
}

std::string pose_columns(const Rigid3d& pose) {
  const Eigen::Quaterniond q = pose.rotation();
  const Eigen::Vector3d t = pose.translation();
  return fmt::format(" {:.12f} {:.12f} {:.12f} {:.12f} {:.12f} {:.12f} {:.12f}", t.x(), t.y(),
                     t.z(), q.w(), q.x(), q.y(), q.z());
}

std::string ros_camera(double p3) {
  const auto camera = survey_camera();
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  return fmt::format(
      "image_width: {}\nimage_height: {}\ncamera_name: survey\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [{}, 0, {}, 0, {}, {}, 0, 0, 1]\n"
      "distortion_model: plumb_bob\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
      "projection_matrix:\n  rows: 3\n  cols: 4\n  data: [{}, 0, {}, {}, 0, {}, {}, 0, 0, 0, 1, "
      "0]\n",
      camera.width, camera.height, fx, cx, fy, cy, fx, cx, p3, fy, cy);
}

std::string fisheye_text() {
  const auto camera = survey_fisheye();
  const auto& [fx, fy, cx, cy, k1, k2, k3, k4] = camera.params;
  return fmt::format(
      "%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\nfx: {}\nfy: {}\ncx: {}\ncy: {}\n"
      "k1: {}\nk2: {}\nk3: {}\nk4: {}\n",
      camera.width, camera.height, fx, fy, cx, cy, k1, k2, k3, k4);
}

std::string euroc_sensor(double x) {
  const auto camera = survey_camera();
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  return fmt::format(
      "sensor_type: camera\n"
      "T_BS:\n  cols: 4\n  rows: 4\n"
      "  data: [1, 0, 0, {}, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n"
      "rate_hz: 5\nresolution: [{}, {}]\ncamera_model: pinhole\n"
      "intrinsics: [{}, {}, {}, {}]\ndistortion_model: radial-tangential\n"
      "distortion_coefficients: [0, 0, 0, 0]\n",
      x, camera.width, camera.height, fx, fy, cx, cy);
}

}  // namespace

Calibrated<RectifiedStereo> survey_camera() { return {{260, 260, 159.5, 119.5, 0.12}, 320, 240}; }

Rigid3d survey_pose(int frame) {
  const double s = frame;
  const Eigen::Quaterniond turn =
      Eigen::AngleAxisd(-0.01 * s, Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(0.02 * std::sin(0.7 * s), Eigen::Vector3d::UnitX()) *
      Eigen::AngleAxisd(0.01 * s, Eigen::Vector3d::UnitZ());
  return {turn, Eigen::Vector3d(0.22 * s - 0.8, 0.03 * std::sin(0.9 * s), 0.03 * s)};
}

Calibrated<KannalaBrandt> survey_fisheye() {
  return {{118, 118, 181, 177, -0.01, 0.002, 0, 0}, 360, 360};
}

Rigid3d survey_fisheye_pose(int frame) {
  const double s = frame;
  const Rigid3d stereo_from_fish(
      Eigen::Quaterniond(Eigen::AngleAxisd(-0.7 + 0.05 * s, Eigen::Vector3d::UnitY())),
      Eigen::Vector3d(1.2, 0.1 + 0.02 * s, 0.8));
  return survey_pose(frame) * stereo_from_fish;
}

fs::path kitti_image(const fs::path& root, bool right, int frame) {
  return root / "sequences/00" / (right ? "image_1" : "image_0") / fmt::format("{:06d}.png", frame);
}

void write_kitti_survey(const fs::path& root, int frames) {
  std::string times, poses;
  for (int i = 0; i < frames; ++i) {
    const Images& images = survey_images()[static_cast<std::size_t>(there_and_back(i))];
    write_text(kitti_image(root, false, i), images[0]);
    write_text(kitti_image(root, true, i), images[1]);
    times += fmt::format("{:.6f}\n", kSurveyPeriod * i);
    poses += matrix_row(survey_pose(there_and_back(i)));
  }
  const auto camera = survey_camera();
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  write_text(root / "sequences/00/calib.txt", fmt::format("P0: {0} 0 {2} 0 0 {1} {3} 0 0 0 1 0\n"
                                                          "P1: {0} 0 {2} {4} 0 {1} {3} 0 0 0 1 0\n",
                                                          fx, fy, cx, cy, -fx * baseline));
  write_text(root / "sequences/00/times.txt", times);
  write_text(root / "poses/00.txt", poses);
}

void write_uwslam_survey(const fs::path& root, bool truth_as_cam_from_world) {
  const fs::path folder = root / "hybrid/M1";
  // The world's origin is away from the cameras, so that their poses cannot be read both ways.
  const Rigid3d world_from_start(
      Eigen::Quaterniond(Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, 0.2, 0.1).normalized())),
      Eigen::Vector3d(1, -4, 3));
  std::string times, poses;
  for (int i = 0; i < kSurveyFrames; ++i) {
    const Images& images = survey_images()[static_cast<std::size_t>(i)];
    write_text(folder / "images/raw" / fmt::format("{}_left.png", i), images[0]);
    write_text(folder / "images/raw" / fmt::format("{}_right.png", i), images[1]);
    write_text(folder / "images/raw" / fmt::format("{}_fish.png", i), images[2]);
    times += fmt::format("{:.6f}\n", kSurveyPeriod * i);
    const Rigid3d stereo = world_from_start * survey_pose(i);
    const Rigid3d fish = world_from_start * survey_fisheye_pose(i);
    poses += std::to_string(i);
    for (const Rigid3d& pose : {fish, stereo}) {
      poses += pose_columns(truth_as_cam_from_world ? inverse(pose) : pose);
    }
    poses += "\n";
  }
  write_text(folder / "times.txt", times);
  write_text(folder / "camera_poses.txt", poses);
  const auto camera = survey_camera();
  write_text(root / "hybrid/calibration/left_camera.yaml", ros_camera(0));
  write_text(root / "hybrid/calibration/fisheye_calib.yaml", fisheye_text());
  write_text(root / "hybrid/calibration/right_camera.yaml",
             ros_camera(-camera.params[0] * camera.params[4]));
}

void write_euroc_survey(const fs::path& root) {
  for (int side = 0; side < 2; ++side) {
    const fs::path folder = root / "mav0" / (side == 0 ? "cam0" : "cam1");
    std::string list = "#timestamp [ns],filename\n";
    for (int i = 0; i < kSurveyFrames; ++i) {
      const std::string stamp = fmt::format("{}", 1400000000000000000 + 200000000LL * i);
      write_text(folder / "data" / (stamp + ".png"),
                 survey_images()[static_cast<std::size_t>(i)][static_cast<std::size_t>(side)]);
      list += stamp + "," + stamp + ".png\n";
    }
    write_text(folder / "data.csv", list);
    write_text(folder / "sensor.yaml", euroc_sensor(side * survey_camera().params[4]));
  }
}

}  // namespace hybrid_slam
