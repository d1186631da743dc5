#include "frontend/input/image_sequence.h"

#include <filesystem>

#include <opencv2/core.hpp>

#include "frontend/input/file_sequence.h"

namespace hybrid_slam {

namespace fs = std::filesystem;

namespace {

std::unique_ptr<ImageSequence> open_layout(const fs::path& path, SequenceLayout layout,
                                           const std::string& name, SequenceCameras cameras,
                                           TruthConvention convention,
                                           const InputOptions& options) {
  const bool any = layout == SequenceLayout::kAuto;
  std::unique_ptr<ImageSequence> sequence;
  if (any || layout == SequenceLayout::kKitti) sequence = open_kitti(path, name, options);
  if (!sequence && (any || layout == SequenceLayout::kKitti)) {
    sequence = open_kitti_raw(path, name, options);
  }
  if (!sequence && (any || layout == SequenceLayout::kEuroc))
    sequence = open_euroc(path, name, options);
  if (!sequence && (any || layout == SequenceLayout::kUwslam)) {
    sequence = open_uwslam(path, name, cameras, convention, options);
  }
  if (!sequence && (any || layout == SequenceLayout::kFourSeasons)) {
    sequence = open_four_seasons(path, name, options);
  }
  return sequence;
}

const char* expected_files(SequenceLayout layout) {
  switch (layout) {
    case SequenceLayout::kKitti:
      return "no KITTI sequence here (image_0/, image_1/, calib.txt, times.txt)";
    case SequenceLayout::kEuroc:
      return "no EuRoC sequence here (mav0/cam0/, mav0/cam1/)";
    case SequenceLayout::kUwslam:
      return "no UWslam sequence here (images/, times.txt, calibration/)";
    case SequenceLayout::kFourSeasons:
      return "no 4Seasons sequence here (undistorted_images/ or distorted_images/, times.txt)";
    case SequenceLayout::kAuto:
      break;
  }
  return "no sequence in a known layout here (KITTI, EuRoC, UWslam or 4Seasons; other folders are "
         "given by --left, --right and --calibration)";
}

}  // namespace

std::unique_ptr<ImageSequence> open_sequence(const std::string& path, SequenceLayout layout,
                                             const std::string& name, SequenceCameras cameras,
                                             TruthConvention convention,
                                             const InputOptions& options) {
  cv::setNumThreads(1);  // OpenCV's setting is global; threads are the pipeline's to make
  try {
    if (!fs::is_directory(path)) throw InputError(path + ": no such folder");
    auto sequence = open_layout(path, layout, name, cameras, convention, options);
    if (!sequence) {
      const std::string wanted = name.empty() ? "" : " of the name \"" + name + "\"";
      throw InputError(path + ": " + expected_files(layout) + wanted);
    }
    return sequence;
  } catch (const fs::filesystem_error& error) {
    throw InputError(error.path1().string() + ": " + error.code().message());
  }
}

}  // namespace hybrid_slam
