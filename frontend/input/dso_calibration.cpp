#include "frontend/input/dso_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "frontend/input/pose_rows.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

constexpr double kSame = 1e-5;  // relative, or [rad]: less than a hundredth of a pixel

struct Model {
  const char* name;
  std::size_t distortion;  // how many numbers
  bool is_fisheye;
};
constexpr std::array<Model, 4> kModels{Model{"Pinhole", 0, false}, Model{"RadTan", 4, false},
                                       Model{"EquiDistant", 4, true},
                                       Model{"KannalaBrandt", 4, true}};

bool is_dso_name(std::string_view word) {
  return word == "FOV" || std::any_of(kModels.begin(), kModels.end(),
                                      [&](const Model& model) { return model.name == word; });
}

const Model& model_of(std::string_view name, const fs::path& path, int line) {
  const auto model = std::find_if(kModels.begin(), kModels.end(),
                                  [&](const Model& known) { return known.name == name; });
  if (model == kModels.end()) {
    throw line_error(path, line,
                     "the camera model " + quote(name) +
                         " is not supported (Pinhole, RadTan, EquiDistant, KannalaBrandt are)");
  }
  return *model;
}

ImageSize read_size(const TextLine& line, const fs::path& path) {
  const std::vector<std::string_view> fields = split_fields(line.text, ' ');
  if (fields.size() != 2) throw line_error(path, line.number, "expected width and height");
  std::array<double, 2> size{};
  for (std::size_t i = 0; i < 2; ++i) {
    size[i] = parse_number(fields[i], path, line.number);
    if (!(size[i] >= 1 && size[i] <= 65536)) {
      throw line_error(path, line.number, "is no size of an image");
    }
  }
  return {static_cast<int>(size[0]), static_cast<int>(size[1])};
}

RawCamera read_camera(const fs::path& path) {
  const std::vector<TextLine> lines = read_lines(path);
  if (lines.size() < 2) {
    throw InputError(path.string() + ": expected a line of the camera and one of its size");
  }
  const int line = lines[0].number;
  const std::vector<std::string_view> fields = split_fields(lines[0].text, ' ');
  const Model& model = model_of(fields[0], path, line);
  std::vector<double> numbers;
  for (std::size_t i = 1; i < fields.size(); ++i) {
    numbers.push_back(parse_number(fields[i], path, line));
  }
  const std::size_t count = 4 + model.distortion;
  // Files have zeros for distortion that the model lacks.
  while (numbers.size() > count && numbers.back() == 0) numbers.pop_back();
  if (numbers.size() != count) {
    throw line_error(path, line,
                     std::string(model.name) + " has " + std::to_string(count) + " numbers");
  }
  RawCamera camera;
  camera.size = read_size(lines[1], path);
  if (numbers[2] < 1 && numbers[3] < 1) {  // fractions of the image
    const double w = camera.size.width, h = camera.size.height;
    numbers[0] *= w, numbers[1] *= h;
    numbers[2] = numbers[2] * w - 0.5, numbers[3] = numbers[3] * h - 0.5;
  }
  const auto checked = make_stereo_camera(numbers[0], numbers[1], numbers[2], numbers[3], 1,
                                          camera.size, path.string());
  camera.fx = checked.params[0], camera.fy = checked.params[1];
  camera.cx = checked.params[2], camera.cy = checked.params[3];
  camera.is_fisheye = model.is_fisheye;
  camera.distortion.assign(4, 0.0);
  std::copy_n(numbers.begin() + 4, model.distortion, camera.distortion.begin());
  return camera;
}

Rigid3d read_transform(const fs::path& path) {
  NumberRow all;
  for (const NumberRow& row : read_number_rows(path, ' ')) {
    if (all.line == 0) all.line = row.line;
    all.values.insert(all.values.end(), row.values.begin(), row.values.end());
  }
  if (all.values.size() != 16) throw InputError(path.string() + ": expected a matrix of 4x4");
  all.values.resize(12);
  return kitti_pose(all, path);
}

// Side by side, and alike.
bool is_rectified(const RawPair& pair) {
  const RawCamera &a = pair.left, &b = pair.right;
  const auto same = [](double x, double y) { return std::abs(x - y) <= kSame * std::abs(x); };
  const auto plain = [](const RawCamera& camera) {
    return !camera.is_fisheye && std::all_of(camera.distortion.begin(), camera.distortion.end(),
                                             [](double d) { return d == 0; });
  };
  const Eigen::Vector3d t = pair.right_from_left.translation();
  return plain(a) && plain(b) && a.size == b.size && same(a.fx, b.fx) && same(a.fy, b.fy) &&
         same(a.cx, b.cx) && same(a.cy, b.cy) &&
         pair.right_from_left.rotation().angularDistance(Eigen::Quaterniond::Identity()) < kSame &&
         std::hypot(t.y(), t.z()) <= kSame * std::abs(t.x());
}

}  // namespace

bool is_dso_camera(const fs::path& path) {
  const std::vector<TextLine> lines = read_lines(path);
  if (lines.empty()) return false;
  const std::vector<std::string_view> fields = split_fields(lines[0].text, ' ');
  return !fields.empty() && is_dso_name(fields[0]);
}

PairCalibration read_dso_pair(const fs::path& left, const fs::path& right,
                              const fs::path& right_from_left) {
  PairCalibration result;
  result.source = left.string();
  result.files_used = 3;
  const RawPair pair{read_camera(left), read_camera(right), read_transform(right_from_left)};
  if (is_rectified(pair)) {
    result.rectified =
        make_stereo_camera(pair.left.fx, pair.left.fy, pair.left.cx, pair.left.cy,
                           -pair.right_from_left.translation().x(), pair.left.size, result.source);
  } else {
    result.raw = pair;
  }
  return result;
}

}  // namespace hybrid_slam
