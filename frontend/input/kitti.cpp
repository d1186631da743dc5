#include <algorithm>
#include <array>
#include <cmath>

#include "frontend/input/file_sequence.h"
#include "frontend/input/kitti_calibration.h"
#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

// KITTI odometry: sequences/<id>/{image_0,image_1}/<number>.png, calib.txt, times.txt and, beside
// sequences/, poses/<id>.txt. Of the colour images, image_2 and image_3.
namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr double kMaxRelativeDifference = 1e-6;  // between the two cameras of a rectified pair

using CameraPair = std::array<const char*, 2>;
constexpr CameraPair kGrayPair{"image_0", "image_1"};
constexpr CameraPair kColorPair{"image_2", "image_3"};

// The line of calib.txt that has a camera's matrix.
std::string label_of(const char* camera) { return "P" + std::string(camera).substr(6) + ":"; }

bool is_kitti_sequence(const fs::path& folder) {
  const auto has = [&](const char* camera) { return fs::is_directory(folder / camera); };
  return std::any_of(kGrayPair.begin(), kGrayPair.end(), has) ||
         std::any_of(kColorPair.begin(), kColorPair.end(), has);
}

// The 3x4 matrix of the line that starts with `label`.
std::vector<double> projection_matrix(const std::vector<TextLine>& lines, const fs::path& path,
                                      const std::string& label) {
  for (const TextLine& line : lines) {
    if (!line.text.starts_with(label)) continue;
    std::vector<double> matrix;
    for (const std::string_view field :
         split_fields(std::string_view(line.text).substr(label.size()), ' ')) {
      matrix.push_back(parse_number(field, path, line.number));
    }
    if (matrix.size() != 12) {
      throw line_error(path, line.number, label + " expected 12 numbers");
    }
    return matrix;
  }
  throw InputError(path.string() + ": no line \"" + label + "\"");
}

struct KittiCalibration {
  Calibrated<RectifiedStereo> stereo;
  Eigen::Vector3d left_in_cam0 = Eigen::Vector3d::Zero();  // [m]; the truth is that of camera 0
};

KittiCalibration read_calibration(const fs::path& path, const CameraPair& cameras, ImageSize size) {
  const std::vector<TextLine> lines = read_lines(path);
  const std::string left_label = label_of(cameras[0]), right_label = label_of(cameras[1]);
  const std::vector<double> left = projection_matrix(lines, path, left_label);
  const std::vector<double> right = projection_matrix(lines, path, right_label);
  for (const std::size_t i : {0, 2, 5, 6}) {
    if (!(std::abs(left[i] - right[i]) <= kMaxRelativeDifference * std::abs(left[i]))) {
      throw InputError(path.string() + ": " + left_label.substr(0, 2) + " and " +
                       right_label.substr(0, 2) + " are not those of a rectified pair");
    }
  }
  const double baseline = (left[3] - right[3]) / left[0];
  KittiCalibration result;
  result.stereo =
      make_stereo_camera(left[0], left[5], left[2], left[6], baseline, size, path.string());
  const double depth = left[11];  // P = K (I | t), t = left_from_cam0
  result.left_in_cam0 = -Eigen::Vector3d((left[3] - left[2] * depth) / left[0],
                                         (left[7] - left[6] * depth) / left[5], depth);
  return result;
}

void read_truth(const fs::path& path, const NumberedFrames& frames, std::size_t rows_of_times,
                const Eigen::Vector3d& left_in_cam0, SequenceInfo& info) {
  const Rigid3d cam0_from_left(Eigen::Quaterniond::Identity(), left_in_cam0);
  const std::vector<NumberRow> rows = read_number_rows(path, ' ');
  if (rows.size() != rows_of_times) {
    info.warnings.push_back(path.string() + ": has " + std::to_string(rows.size()) + " poses for " +
                            std::to_string(rows_of_times) + " times");
  }
  const std::size_t first = static_cast<std::size_t>(frames.first);
  for (std::size_t i = 0; i < frames.times.size() && first + i < rows.size(); ++i) {
    info.truth.push_back({frames.times[i], kitti_pose(rows[first + i], path) * cam0_from_left});
  }
  info.truth_has_rotation = !info.truth.empty();
}

}  // namespace

Calibrated<RectifiedStereo> read_kitti_stereo(const fs::path& path, bool color, ImageSize size) {
  return read_calibration(path, color ? kColorPair : kGrayPair, size).stereo;
}

std::unique_ptr<ImageSequence> open_kitti(const fs::path& path, const std::string& name,
                                          const InputOptions& options) {
  SequenceInfo info;
  const auto folder =
      choose_sequence(path, {path, path / "sequences"}, name, is_kitti_sequence, info.warnings);
  if (!folder) return nullptr;
  info.name = folder_name(*folder);
  info.layout = "kitti";
  const bool has_gray =
      fs::is_directory(*folder / "image_0") || fs::is_directory(*folder / "image_1");
  const CameraPair& cameras = has_gray ? kGrayPair : kColorPair;
  const NumberedImages left = list_numbered_images(*folder / cameras[0], "");
  const NumberedImages right = list_numbered_images(*folder / cameras[1], "");
  for (const auto& [images, side] : {std::pair(&left, cameras[0]), std::pair(&right, cameras[1])}) {
    if (images->empty()) throw InputError((*folder / side).string() + ": holds no images");
  }
  const std::vector<double> times = read_times(*folder / "times.txt", info.warnings);
  NumberedFrames frames = match_frames(times, *folder / "times.txt", left, right, info.warnings);
  const KittiCalibration calibration =
      read_calibration(*folder / "calib.txt", cameras, first_image_size(frames.files));
  info.stereo = calibration.stereo;
  const fs::path truth =
      fs::absolute(*folder).lexically_normal() / ".." / ".." / "poses" / (info.name + ".txt");
  if (fs::exists(truth.lexically_normal())) {
    read_truth(truth.lexically_normal(), frames, times.size(), calibration.left_in_cam0, info);
  }
  info.times = std::move(frames.times);
  return std::make_unique<FileSequence>(std::move(info), std::move(frames.files), options, nullptr);
}

}  // namespace hybrid_slam
