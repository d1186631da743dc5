#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frontend/input/image_file.h"
#include "frontend/input/image_sequence.h"
#include "frontend/input/rectification.h"
#include "frontend/input/stored_sequence.h"

// What the readers of all layouts share.
namespace hybrid_slam {

// The images of one frame; a path is empty where the dataset holds no such image.
struct FramePaths {
  std::filesystem::path left;
  std::filesystem::path right;
  std::filesystem::path fisheye;
};

// A sequence whose images are files.
class FileSequence final : public StoredSequence {
 public:
  FileSequence(SequenceInfo info, std::vector<FramePaths> files, const InputOptions& options,
               std::unique_ptr<const StereoRectifier> rectifier);

  const FramePaths& files(std::size_t frame) const { return files_->at(frame); }

 private:
  using SharedPaths = std::shared_ptr<const std::vector<FramePaths>>;
  FileSequence(SequenceInfo info, SharedPaths files, const InputOptions& options,
               std::unique_ptr<const StereoRectifier> rectifier);

  SharedPaths files_;
};

// Images of a folder by their number: files named <digits><suffix>.<png|jpg|...>. Throws
// InputError if the folder is missing or a number occurs twice.
using NumberedImages = std::map<int, std::filesystem::path>;
NumberedImages list_numbered_images(const std::filesystem::path& folder, const std::string& suffix);

// Frames of a layout in which row n of the times belongs to the images of number n.
struct NumberedFrames {
  int first = 0;  // number of frames.front(); the numbers have no gaps
  std::vector<FramePaths> files;
  std::vector<double> times;
};

// Rows before the first and after the last image are left out with a warning (a part of a dataset
// was copied); an image missing in between stays as an empty path, counted in a warning. Throws
// InputError if an image has no time, and as check_completeness does.
NumberedFrames match_frames(const std::vector<double>& times,
                            const std::filesystem::path& times_path, const NumberedImages& left,
                            const NumberedImages& right, std::vector<std::string>& warnings);

// Warns of frames that lack an image. Throws InputError if more than half do: left and right do not
// belong together, or the copy failed.
void check_completeness(const std::vector<FramePaths>& files, const std::string& where,
                        std::vector<std::string>& warnings);

// Size of the first left image whose header can be read. Throws InputError if there is none.
ImageSize first_image_size(const std::vector<FramePaths>& files);

// Throws InputError, starting with `source`, unless the numbers can be those of a camera with
// images of this size.
Calibrated<RectifiedStereo> make_stereo_camera(double fx, double fy, double cx, double cy,
                                               double baseline, ImageSize size,
                                               const std::string& source);

// Adds the fisheye's images to frames that begin with number `first`; warns of those that lack one.
void add_fisheye_images(const NumberedImages& images, int first, std::vector<FramePaths>& files,
                        const std::string& where, std::vector<std::string>& warnings);

// What of baseline and times is so far beyond what rigs have that it seems written in other units;
// one line each.
std::vector<std::string> doubts_of_units(const SequenceInfo& info);

// Throws InputError, starting with `source`, if the two sizes differ.
void check_image_size(ImageSize image, ImageSize calibrated, const std::string& source);

// The folder of sequence `name`, looked for in `parents` (none of which need exist), or `path`
// itself; with an empty name `path` itself or the first in alphabetical order. None if there is no
// sequence at all. Throws InputError if there are some, but none of this name.
std::optional<std::filesystem::path> choose_sequence(
    const std::filesystem::path& path, const std::vector<std::filesystem::path>& parents,
    const std::string& name, const std::function<bool(const std::filesystem::path&)>& is_sequence,
    std::vector<std::string>& warnings);

// Last part of a path, also of "sequences/00/" and ".".
std::string folder_name(const std::filesystem::path& path);

// One file per layout. Null if there is no dataset of this layout at `path`; what can be recognised
// but not used throws InputError.
std::unique_ptr<ImageSequence> open_kitti(const std::filesystem::path& path,
                                          const std::string& name, const InputOptions& options);
std::unique_ptr<ImageSequence> open_kitti_raw(const std::filesystem::path& path,
                                              const std::string& name, const InputOptions& options);
std::unique_ptr<ImageSequence> open_euroc(const std::filesystem::path& path,
                                          const std::string& name, const InputOptions& options);
std::unique_ptr<ImageSequence> open_four_seasons(const std::filesystem::path& path,
                                                 const std::string& name,
                                                 const InputOptions& options);
std::unique_ptr<ImageSequence> open_uwslam(const std::filesystem::path& path,
                                           const std::string& name, SequenceCameras cameras,
                                           TruthConvention convention, const InputOptions& options);

}  // namespace hybrid_slam
