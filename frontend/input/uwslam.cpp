#include <algorithm>
#include <cmath>

#include "cameras/calibration/calibration_file.h"
#include "frontend/input/camera_poses.h"
#include "frontend/input/file_sequence.h"
#include "frontend/input/fisheye_calibration.h"
#include "frontend/input/text_file.h"

// UWslam: hybrid/<sequence>/images/raw/<number>_{left,right,fish}.<png|jpg> with camera_poses.txt
// and hybrid/calibration/; stereo/images/<number>_{0,1}.<png|jpg> with gt_poses.txt and
// stereo/calibration/. Stereo images are rectified; row n of times.txt (or time.txt) belongs to the
// images of number n.
namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

bool is_uwslam_sequence(const fs::path& folder) {
  if (!fs::is_directory(folder / "images")) return false;
  if (fs::is_directory(folder / "images" / "raw")) return true;
  const auto has = [&](const char* file) { return fs::exists(folder / file); };
  return has("times.txt") || has("time.txt") || has("gt_poses.txt") || has("calibration");
}

std::optional<fs::path> choose_folder(const fs::path& path, const std::string& name,
                                      std::vector<std::string>& warnings) {
  return choose_sequence(path, {path, path / "hybrid"}, name, is_uwslam_sequence, warnings);
}

fs::path times_file(const fs::path& folder) {
  const fs::path singular = folder / "time.txt";
  return !fs::exists(folder / "times.txt") && fs::exists(singular) ? singular
                                                                   : folder / "times.txt";
}

struct ImageLists {
  NumberedImages left, right, fisheye;
};

ImageLists list_images(const fs::path& folder) {
  const fs::path raw = folder / "images" / "raw";
  const fs::path images = fs::is_directory(raw) ? raw : folder / "images";
  ImageLists lists{list_numbered_images(images, "_left"), list_numbered_images(images, "_right"),
                   list_numbered_images(images, "_fish")};
  std::string left_suffix = "_left", right_suffix = "_right";
  if (lists.left.empty() && lists.right.empty()) {
    lists = {list_numbered_images(images, "_0"), list_numbered_images(images, "_1"), {}};
    if (!lists.left.empty() || !lists.right.empty()) left_suffix = "_0", right_suffix = "_1";
  }
  if (lists.left.empty() && lists.right.empty()) {
    throw InputError(images.string() + ": holds no images <number>_left or <number>_0");
  }
  for (const auto& [list, suffix] :
       {std::pair(&lists.left, left_suffix), std::pair(&lists.right, right_suffix)}) {
    if (list->empty()) throw InputError(images.string() + ": holds no images <number>" + suffix);
  }
  return lists;
}

fs::path calibration_folder(const fs::path& folder) {
  const fs::path own = folder / "calibration";
  return fs::is_directory(own) ? own
                               : fs::absolute(folder / ".." / "calibration").lexically_normal();
}

// Size of the first image whose header can be read. Throws InputError if there is none.
ImageSize first_readable_size(const NumberedImages& images) {
  std::string first_error;
  for (const auto& [number, path] : images) {
    try {
      return read_image_size(path);
    } catch (const InputError& error) {
      if (first_error.empty()) first_error = error.what();
    }
  }
  throw InputError(first_error);
}

Calibrated<RectifiedStereo> read_calibration(const fs::path& place) {
  const auto camera = read_ros_stereo((place / "left_camera.yaml").string(),
                                      (place / "right_camera.yaml").string());
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  return make_stereo_camera(fx, fy, cx, cy, baseline, {camera.width, camera.height},
                            place.string());
}

// The fisheye, if it is wanted and there is one.
void add_fisheye(const fs::path& folder, const NumberedImages& images, SequenceCameras cameras,
                 NumberedFrames& frames, SequenceInfo& info) {
  if (cameras == SequenceCameras::kStereo) return;
  if (images.empty()) {
    if (cameras == SequenceCameras::kHybrid) {
      info.warnings.push_back(folder.string() + ": holds no fisheye images <number>_fish");
    }
    return;
  }
  add_fisheye_images(images, frames.first, frames.files, folder.string(), info.warnings);
  info.fisheye = read_fisheye_of_images(calibration_folder(folder) / "fisheye_calib.yaml",
                                        first_readable_size(images), info.warnings);
}

// Positions only: "timestamp x y z", or "x y z" with row n belonging to index n.
void read_positions(const fs::path& path, const std::vector<double>& times, SequenceInfo& info) {
  const std::vector<NumberRow> rows = read_number_rows(path, ' ');
  if (rows.empty()) return;
  const std::size_t columns = rows.front().values.size();
  if (columns != 3 && columns != 4) {
    throw line_error(path, rows.front().line, "expected 3 or 4 numbers");
  }
  if (columns == 3 && rows.size() != times.size()) {
    info.warnings.push_back(path.string() + ": has " + std::to_string(rows.size()) +
                            " positions for " + std::to_string(times.size()) + " times");
  }
  const bool nanoseconds = columns == 4 && rows.back().values[0] >= kLeastNanoseconds;
  if (nanoseconds) info.warnings.push_back(path.string() + ": times read as nanoseconds");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::vector<double>& v = rows[i].values;
    if (v.size() != columns) {
      throw line_error(path, rows[i].line, "expected " + std::to_string(columns) + " numbers");
    }
    if (columns == 3 && i == times.size()) break;
    const double time = columns == 4 ? v[0] * (nanoseconds ? 1e-9 : 1) : times[i];
    if (!info.truth.empty() && !(time > info.truth.back().time)) {
      throw line_error(path, rows[i].line, "times are not strictly ascending");
    }
    const Eigen::Vector3d position(v[columns - 3], v[columns - 2], v[columns - 1]);
    info.truth.push_back({time, Rigid3d(Eigen::Quaterniond::Identity(), position)});
  }
}

}  // namespace

std::unique_ptr<ImageSequence> open_uwslam(const fs::path& path, const std::string& name,
                                           SequenceCameras cameras, TruthConvention convention,
                                           const InputOptions& options) {
  SequenceInfo info;
  const auto folder = choose_folder(path, name, info.warnings);
  if (!folder) return nullptr;
  info.name = folder_name(*folder);
  info.layout = "uwslam";
  const ImageLists images = list_images(*folder);
  const fs::path times_path = times_file(*folder);
  const std::vector<double> times = read_times(times_path, info.warnings);
  NumberedFrames frames = match_frames(times, times_path, images.left, images.right, info.warnings);
  info.stereo = read_calibration(calibration_folder(*folder));
  check_image_size(first_image_size(frames.files), {info.stereo.width, info.stereo.height},
                   folder->string() + ": calibration");
  add_fisheye(*folder, images.fisheye, cameras, frames, info);
  if (fs::exists(*folder / "camera_poses.txt")) {
    CameraPoses poses = read_camera_poses(*folder / "camera_poses.txt", times, convention);
    info.truth = std::move(poses.stereo);
    info.fisheye_truth = std::move(poses.fisheye);
    info.truth_has_rotation = !info.truth.empty();
    info.truth_convention = std::move(poses.convention);
    info.warnings.insert(info.warnings.end(), poses.warnings.begin(), poses.warnings.end());
  } else if (fs::exists(*folder / "gt_poses.txt")) {
    read_positions(*folder / "gt_poses.txt", times, info);
  }
  info.times = std::move(frames.times);
  return std::make_unique<FileSequence>(std::move(info), std::move(frames.files), options, nullptr);
}

}  // namespace hybrid_slam
