#include <fmt/format.h>

#include <stdexcept>

#include "apps/io/trajectory.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {

std::string tum_line(const StampedPose& pose) {
  const auto& t = pose.world_from_cam.translation();
  Eigen::Vector4d q = pose.world_from_cam.rotation().coeffs();
  if (q.w() < 0) q = -q;
  if (!q.allFinite() || !t.allFinite()) {
    throw std::logic_error("a pose of the trajectory is not finite");
  }
  return fmt::format("{:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}", pose.time, t.x(),
                     t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
}

void write_tum(const std::filesystem::path& path, std::span<const StampedPose> trajectory) {
  std::string text;
  for (const StampedPose& pose : trajectory) text += tum_line(pose) + '\n';
  write_file(path, text);
}

}  // namespace hybrid_slam
