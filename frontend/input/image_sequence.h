#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"
#include "cameras/input_error.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

struct StampedPose {
  double time = 0;         // [s]
  Rigid3d world_from_cam;  // rotation is the identity where the dataset's truth has none
};

// One moment of a stereo sequence: rectified, row-aligned, grey.
struct StereoImages {
  std::int64_t frame_index = 0;
  double time = 0;  // [s]
  GrayImage left;
  GrayImage right;
};

// What the dataset says about itself before any image is decoded.
struct SequenceInfo {
  std::string name;
  std::string layout;  // "kitti", "euroc" or "uwslam"
  Calibrated<RectifiedStereo> stereo;
  std::vector<double> times;       // one per frame [s], strictly ascending
  std::vector<StampedPose> truth;  // left camera; empty where there is none
  bool truth_has_rotation = false;
  std::vector<std::string> warnings;  // one line each: what was found odd and went on without
};

// A sequence of images in one of the known layouts. Calibration, times and the list of files are
// checked when it is opened; images are decoded (and rectified) by read(). read() is const and may
// be called from several threads.
class ImageSequence {
 public:
  virtual ~ImageSequence() = default;
  virtual const SequenceInfo& info() const = 0;
  std::size_t size() const { return info().times.size(); }

  // Throws InputError if a file of this frame is missing, truncated or of the wrong size: the
  // caller counts the frame as corrupt and goes on.
  virtual StereoImages read(std::size_t frame) const = 0;
};

enum class SequenceLayout { kAuto, kKitti, kEuroc, kUwslam };

// Opens the sequence `name` of the dataset at `path` (empty name: the only or first one).
// Throws InputError with one clear line.
std::unique_ptr<ImageSequence> open_sequence(const std::string& path, SequenceLayout layout,
                                             const std::string& name);

}  // namespace hybrid_slam
