#include "frontend/input/file_sequence.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>

#include "frontend/input/median.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

class FileStore final : public ImageStore {
 public:
  explicit FileStore(std::shared_ptr<const std::vector<FramePaths>> files)
      : files_(std::move(files)) {}
  std::size_t size() const override { return files_->size(); }
  bool has(std::size_t frame, SequenceCamera camera) const override {
    return !path_of(frame, camera).empty();
  }
  DecodedImage decode(std::size_t frame, SequenceCamera camera, std::optional<ImageSize> expected,
                      GrayChannel channel) const override {
    return decode_image_file(path_of(frame, camera), expected, channel);
  }

 private:
  const fs::path& path_of(std::size_t frame, SequenceCamera camera) const {
    const FramePaths& paths = files_->at(frame);
    return camera == SequenceCamera::kLeft    ? paths.left
           : camera == SequenceCamera::kRight ? paths.right
                                              : paths.fisheye;
  }

  std::shared_ptr<const std::vector<FramePaths>> files_;
};

}  // namespace

FileSequence::FileSequence(SequenceInfo info, std::vector<FramePaths> files,
                           const InputOptions& options,
                           std::unique_ptr<const StereoRectifier> rectifier)
    : FileSequence(std::move(info),
                   std::make_shared<const std::vector<FramePaths>>(std::move(files)), options,
                   std::move(rectifier)) {}

FileSequence::FileSequence(SequenceInfo info, SharedPaths files, const InputOptions& options,
                           std::unique_ptr<const StereoRectifier> rectifier)
    : StoredSequence(std::move(info), std::make_unique<const FileStore>(files), options,
                     std::move(rectifier)),
      files_(std::move(files)) {}

NumberedImages list_numbered_images(const fs::path& folder, const std::string& suffix) {
  if (!fs::is_directory(folder)) throw InputError(folder.string() + ": no such folder");
  NumberedImages images;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const fs::path& path = entry.path();
    const std::string stem = path.stem().string();
    if (!has_image_extension(path) || !stem.ends_with(suffix)) continue;
    int number = 0;
    const char* const end = stem.data() + stem.size() - suffix.size();
    const auto [parsed, error] = std::from_chars(stem.data(), end, number);
    if (error != std::errc() || parsed != end || number < 0) continue;
    const auto [other, is_new] = images.emplace(number, path);
    if (!is_new) {
      const auto [low, high] = std::minmax(other->second, path);
      throw InputError(high.string() + ": same number as " + low.filename().string());
    }
  }
  return images;
}

NumberedFrames match_frames(const std::vector<double>& times, const fs::path& times_path,
                            const NumberedImages& left, const NumberedImages& right,
                            std::vector<std::string>& warnings) {
  if (left.empty() || right.empty()) throw std::logic_error("the caller checks for images");
  const int first = std::min(left.begin()->first, right.begin()->first);
  const int last = std::max(left.rbegin()->first, right.rbegin()->first);
  const int rows = static_cast<int>(times.size());
  if (last >= rows) {
    throw InputError(times_path.string() + ": has " + std::to_string(rows) +
                     " times, but there are images up to number " + std::to_string(last));
  }
  if (last - first + 1 < rows) {
    warnings.push_back(times_path.string() + ": has " + std::to_string(rows) +
                       " times, images exist from " + std::to_string(first) + " to " +
                       std::to_string(last) + "; the other times are left out");
  }
  NumberedFrames frames;
  frames.first = first;
  for (int number = first; number <= last; ++number) {
    const auto left_path = left.find(number);
    const auto right_path = right.find(number);
    frames.files.push_back({left_path == left.end() ? fs::path() : left_path->second,
                            right_path == right.end() ? fs::path() : right_path->second,
                            {}});
    frames.times.push_back(times[static_cast<std::size_t>(number)]);
  }
  const fs::path folder = left.begin()->second.parent_path();
  check_completeness(frames.files, folder.parent_path().string(), warnings);
  return frames;
}

void check_completeness(const std::vector<FramePaths>& files, const std::string& where,
                        std::vector<std::string>& warnings) {
  const auto lacks = [](const FramePaths& f) { return f.left.empty() || f.right.empty(); };
  const auto count = std::count_if(files.begin(), files.end(), lacks);
  if (count == 0) return;
  const auto first = std::find_if(files.begin(), files.end(), lacks) - files.begin();
  const std::string line =
      where + ": " + std::to_string(count) + " of " + std::to_string(files.size()) +
      " frames lack an image (first: frame " + std::to_string(first) + ", " +
      (files[static_cast<std::size_t>(first)].left.empty() ? "left" : "right") + ")";
  if (2 * static_cast<std::size_t>(count) > files.size()) throw InputError(line);
  warnings.push_back(line);
}

void add_fisheye_images(const NumberedImages& images, int first, std::vector<FramePaths>& files,
                        const std::string& where, std::vector<std::string>& warnings) {
  std::size_t missing = 0;
  for (std::size_t i = 0; i < files.size(); ++i) {
    const auto image = images.find(first + static_cast<int>(i));
    if (image == images.end()) {
      ++missing;
    } else {
      files[i].fisheye = image->second;
    }
  }
  if (missing > 0) {
    warnings.push_back(where + ": " + std::to_string(missing) + " of " +
                       std::to_string(files.size()) + " frames lack a fisheye image");
  }
}

// A stereo rig is some centimetres to a few metres wide, and its images come every few seconds at
// most: what is far beyond was written in other units.
std::vector<std::string> doubts_of_units(const SequenceInfo& info) {
  constexpr double kWidest = 5;         // [m]
  constexpr double kNarrowest = 0.002;  // [m]
  constexpr double kSlowest = 1000;     // [s] between frames
  constexpr double kFastest = 1e-5;     // [s]
  std::vector<std::string> doubts;
  const auto warn = [&](const char* what, double value, const char* question) {
    char text[160];
    std::snprintf(text, sizeof(text), "%s %.6g %s", what, value, question);
    doubts.push_back(info.name + ": " + text);
  };
  const double baseline = info.stereo.params[4];
  if (baseline > kWidest) {
    warn("the baseline is", baseline, "m: is the calibration in millimetres?");
  } else if (baseline < kNarrowest) {
    warn("the baseline is", baseline, "m: is the calibration in another unit?");
  }
  if (info.times.size() < 2) return doubts;
  std::vector<double> steps;
  for (std::size_t i = 1; i < info.times.size(); ++i) {
    steps.push_back(info.times[i] - info.times[i - 1]);
  }
  const double step = median(std::move(steps));
  if (step > kSlowest) {
    warn("frames are", step, "s apart: are the times in milli- or nanoseconds?");
  } else if (step < kFastest) {
    warn("frames are", step, "s apart: are the times in seconds?");
  }
  return doubts;
}

ImageSize first_image_size(const std::vector<FramePaths>& files) {
  std::string first_error = "the dataset holds no left images";
  bool failed = false;
  for (const FramePaths& paths : files) {
    if (paths.left.empty()) continue;
    try {
      return read_image_size(paths.left);
    } catch (const InputError& error) {
      if (!failed) first_error = error.what();
      failed = true;
    }
  }
  throw InputError(first_error);
}

Calibrated<RectifiedStereo> make_stereo_camera(double fx, double fy, double cx, double cy,
                                               double baseline, ImageSize size,
                                               const std::string& source) {
  for (const double value : {fx, fy, cx, cy, baseline}) {
    if (!std::isfinite(value)) throw InputError(source + ": a value is not finite");
  }
  if (!(fx > 0 && fy > 0)) throw InputError(source + ": the focal length is not positive");
  if (!(baseline > 0)) {
    throw InputError(source +
                     ": the baseline is not positive; are the cameras or their files exchanged?");
  }
  if (!(cx > 0 && cx < size.width && cy > 0 && cy < size.height)) {
    throw InputError(source + ": the principal point lies outside the image");
  }
  return {{fx, fy, cx, cy, baseline}, size.width, size.height};
}

void check_image_size(ImageSize image, ImageSize calibrated, const std::string& source) {
  if (image == calibrated) return;
  throw InputError(source + ": calibrated for " + std::to_string(calibrated.width) + "x" +
                   std::to_string(calibrated.height) + ", but the images are " +
                   std::to_string(image.width) + "x" + std::to_string(image.height));
}

std::string folder_name(const fs::path& path) {
  const fs::path whole = fs::absolute(path).lexically_normal();
  return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
}

std::optional<fs::path> choose_sequence(const fs::path& path, const std::vector<fs::path>& parents,
                                        const std::string& name,
                                        const std::function<bool(const fs::path&)>& is_sequence,
                                        std::vector<std::string>& warnings) {
  if (name.empty() ? is_sequence(path) : (folder_name(path) == name && is_sequence(path))) {
    return path;
  }
  std::vector<fs::path> found;
  for (const fs::path& parent : parents) {
    if (!fs::is_directory(parent)) continue;
    for (const fs::directory_entry& entry : fs::directory_iterator(parent)) {
      if (entry.is_directory() && is_sequence(entry.path())) found.push_back(entry.path());
    }
  }
  std::sort(found.begin(), found.end());
  std::string names;
  for (const fs::path& folder : found) {
    if (folder.filename() == name) return folder;
    names += (names.empty() ? "" : ", ") + folder.filename().string();
  }
  if (!name.empty()) {
    if (is_sequence(path)) names = folder_name(path) + (names.empty() ? "" : ", ") + names;
    if (names.empty()) return std::nullopt;
    throw InputError(path.string() + ": no sequence \"" + name + "\"; there is: " + names);
  }
  if (found.empty()) return std::nullopt;
  if (found.size() > 1) {
    warnings.push_back(path.string() + ": holds several sequences (" + names + "); took " +
                       found.front().filename().string());
  }
  return found.front();
}

}  // namespace hybrid_slam
