#include "apps/hybrid_slam/frame_writer.h"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "apps/io/trajectory.h"
#include "apps/slam/frame_figures.h"
#include "cameras/geometry/uncertain_motion.h"

namespace hybrid_slam {
namespace {

constexpr std::array kAxes = {"x", "y", "z", "rx", "ry", "rz"};

// Columns of a pose, of the upper triangle of its covariance, and what they hold.
std::string pose_columns(const std::string& prefix) {
  std::string text;
  for (const char* name : {"tx", "ty", "tz", "qx", "qy", "qz", "qw"}) text += "," + prefix + name;
  return text;
}

std::string covariance_columns() {
  std::string text;
  for (std::size_t i = 0; i < kAxes.size(); ++i) {
    for (std::size_t j = i; j < kAxes.size(); ++j) {
      text += fmt::format(",cov_{}_{}", kAxes[i], kAxes[j]);
    }
  }
  return text;
}

std::string values(const Rigid3d& pose) {
  const auto& t = pose.translation();
  Eigen::Vector4d q = pose.rotation().coeffs();
  if (q.w() < 0) q = -q;
  return fmt::format(",{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}", t.x(), t.y(), t.z(),
                     q.x(), q.y(), q.z(), q.w());
}

std::string values(const Matrix6d& covariance) {
  std::string text;
  for (Eigen::Index i = 0; i < 6; ++i) {
    for (Eigen::Index j = i; j < 6; ++j) text += fmt::format(",{:.6e}", covariance(i, j));
  }
  return text;
}

std::string commas(int count) { return std::string(static_cast<std::size_t>(count), ','); }

constexpr int kPoseColumns = 7;
constexpr int kCovarianceColumns = 21;

std::string id_of(KeyframeId id) { return id.valid() ? fmt::format(",{}", id.value) : ","; }

std::string header() {
  return "camera,time,index,state,source,prediction,causes" + pose_columns("") +
         ",sigma_position,sigma_rotation_deg,covariance_base,reference" +
         pose_columns("reference_") +
         ",features,stereo_matches,inliers,odometer_inliers,keyframes,landmarks" +
         covariance_columns() + ",component,row_error_px";
}

// The frame's pose in the map, how far off it may be, and the motion from its reference keyframe,
// through which it follows what becomes of the map.
std::string pose_values(const TrackedFrame& tracked, const PoseFigures& figures) {
  std::string text = values(figures.world_from_cam);
  text += fmt::format(",{:.6g},{:.6g}", figures.sigma_position, figures.sigma_rotation_deg);
  text += id_of(tracked.covariance_base) + id_of(tracked.reference);
  return text + (tracked.reference.valid() ? values(inverse(tracked.cam_from_reference))
                                           : commas(kPoseColumns));
}

std::string row(const FrameResult& frame) {
  const TrackedFrame& tracked = frame.tracked;
  std::string text =
      fmt::format("{},{:.9f},{},{},{},{},{}", to_string(frame.camera), to_seconds(frame.time),
                  frame.index, to_string(frame.state), to_string(tracked.source),
                  to_string(tracked.prediction), causes_text(frame));
  PoseFigures figures;
  if (frame.has_pose()) figures = pose_figures(tracked);
  text +=
      frame.has_pose() ? pose_values(tracked, figures) : commas(kPoseColumns + 4 + kPoseColumns);
  text += fmt::format(",{},{},{},{},{},{}", frame.features, frame.stereo_matches, tracked.inliers,
                      tracked.odometer_inliers, frame.keyframes, frame.landmarks);
  return text + (frame.has_pose() ? values(figures.covariance) : commas(kCovarianceColumns)) +
         id_of(frame.component) +
         (frame.row_error ? fmt::format(",{:.4f}", *frame.row_error) : std::string(","));
}

}  // namespace

FrameWriter::FrameWriter(const std::filesystem::path& folder, bool fisheye,
                         std::function<void(const std::string&)> warn)
    : warn_(std::move(warn)),
      frames_(folder / "frames.csv"),
      times_(folder / "timing.csv"),
      stereo_{LineFile(folder / "stereo_online.tum"), LineFile(folder / "stereo.tum")} {
  append(frames_, header());
  append(times_, "time,cpu_ms,behind_ms");
  if (!fisheye) return;
  fisheye_ = {LineFile(folder / "fisheye_online.tum"), LineFile(folder / "fisheye.tum")};
  fisheye_in_left_ = LineFile(folder / "fisheye_in_left.csv");
  append(fisheye_in_left_, "time" + pose_columns("") + covariance_columns());
}

void FrameWriter::append(LineFile& file, const std::string& line) {
  const std::string failure = file.append(line);
  if (!failure.empty() && warn_) warn_(failure);
}

void FrameWriter::frame(const FrameResult& frame) {
  append(frames_, row(frame));
  if (frame.has_pose()) {
    write_pose(frame.camera == CameraKind::kStereo ? stereo_ : fisheye_, frame);
  }
  if (frame.left_from_fisheye) {
    append(fisheye_in_left_, fmt::format("{:.9f}", to_seconds(frame.time)) +
                                 values(frame.left_from_fisheye->b_from_a) +
                                 values(ros_covariance(*frame.left_from_fisheye)));
  }
}

void FrameWriter::write_pose(Trajectory& files, const FrameResult& frame) {
  const std::string line = tum_line({frame.tracked.time, inverse(frame.tracked.cam_from_world)});
  append(files.online, line);
  append(files.estimate, line);
}

void FrameWriter::left_out(const LeftOut& input) {
  append(frames_, fmt::format("{},{:.9f},,{},,,", to_string(input.camera), to_seconds(input.time),
                              input.reason) +
                      commas(kPoseColumns + 4 + kPoseColumns + 6 + kCovarianceColumns + 2));
}

void FrameWriter::times(const FrameTimes& times) {
  append(times_, fmt::format("{:.6f},{:.3f},{}", times.time, times.cpu_ms,
                             times.behind_ms ? fmt::format("{:.3f}", *times.behind_ms) : ""));
}

}  // namespace hybrid_slam
