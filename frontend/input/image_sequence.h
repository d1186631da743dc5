#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cameras/camera.h"
#include "cameras/files/input_error.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/features/image.h"
#include "frontend/input/image_file.h"

namespace hybrid_slam {

struct StampedPose {
  double time = 0;         // [s]
  Rigid3d world_from_cam;  // rotation is the identity where the dataset's truth has none
};

// One moment of a sequence, grey: a rectified, row-aligned pair, and what the fisheye saw.
struct FrameImages {
  std::int64_t frame_index = 0;  // counted from 0 within the sequence as opened
  double time = 0;               // [s]
  GrayImage left;
  GrayImage right;
  GrayImage fisheye;          // raw; empty without a fisheye, and where its image cannot be read
  std::string fisheye_error;  // why it cannot
};

// What the dataset says about itself before any image is decoded.
struct SequenceInfo {
  std::string name;
  std::string layout;  // "kitti", "euroc", "uwslam", "4seasons" ...
  Calibrated<RectifiedStereo> stereo;
  std::optional<Calibrated<KannalaBrandt>> fisheye;  // none: there is no such camera
  std::vector<double> times;                         // one per frame [s], strictly ascending
  std::vector<StampedPose> truth;  // left camera; empty where there is none, ascending in time
  bool truth_has_rotation = false;
  std::vector<StampedPose> fisheye_truth;  // likewise, of the fisheye; the world is that of `truth`
  std::string truth_convention;       // as the file was read: "world_from_cam", "cam_from_world"
  std::vector<std::string> warnings;  // one line each: what was found odd and went on without
};

// A sequence of images in one of the known layouts. Calibration, truth, times and the list of files
// are checked when it is opened; images are decoded (and rectified) by read(). read() is const and
// may be called from several threads.
class ImageSequence {
 public:
  virtual ~ImageSequence() = default;
  virtual const SequenceInfo& info() const = 0;
  std::size_t size() const { return info().times.size(); }

  // Throws InputError if a stereo image of this frame is missing, truncated, damaged or of the
  // wrong size: the caller counts the frame as corrupt and goes on. Of a fisheye image the frame
  // says so.
  virtual FrameImages read(std::size_t frame) const = 0;
};

// Which cameras are wanted. kHybrid where there is no fisheye: the stereo pair, with a warning.
// kAuto: the fisheye, if there is one.
enum class SequenceCameras { kAuto, kStereo, kHybrid };

enum class SequenceLayout { kAuto, kKitti, kEuroc, kUwslam, kFourSeasons };

// How the poses of UWslam's camera_poses.txt are meant: its documents contradict each other. kAuto
// takes the meaning under which the two cameras are clearly closer together and look at one place;
// where that does not tell, world_from_cam, with a warning.
enum class TruthConvention { kAuto, kWorldFromCam, kCamFromWorld };

struct InputOptions {
  ImageReading images;
  // How far apart in time the images of a pair may be [s]. 0: a tenth of the frame period, at most
  // 10 ms, in which a vehicle hardly moves.
  double pair_tolerance = 0;
};

// Opens the sequence `name` of the dataset at `path`: the dataset's folder, the sequence's own, or
// one between them. An empty name takes the only sequence, or the first with a warning.
//
// Throws InputError with one clear line if no layout fits; a file or folder is missing or cannot be
// understood; times do not ascend; the calibration is not finite, not that of a rectified pair,
// exchanged between left and right, or not for images of this size; there are no images, images
// without a time, or more than half of the frames lack an image.
// KITTI's layouts are those of odometry, grey or colour; a pair of EuRoC's cameras may be fisheyes.
// Goes on with a line in SequenceInfo::warnings if fewer frames lack an image (reading those
// throws), if times reach beyond the images (left out), if timestamps have no partner in the other
// camera (left out), if the truth covers another number of frames, or if frames lack a fisheye
// image. Truth is optional everywhere.
std::unique_ptr<ImageSequence> open_sequence(const std::string& path, SequenceLayout layout,
                                             const std::string& name,
                                             SequenceCameras cameras = SequenceCameras::kStereo,
                                             TruthConvention convention = TruthConvention::kAuto,
                                             const InputOptions& options = {});

}  // namespace hybrid_slam
