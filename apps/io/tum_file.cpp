#include <cstdio>

#include "apps/io/trajectory.h"
#include "cameras/files/output_file.h"

namespace hybrid_slam {

void write_tum(const std::filesystem::path& path, std::span<const StampedPose> trajectory) {
  std::string text;
  for (const StampedPose& pose : trajectory) {
    const auto& t = pose.world_from_cam.translation();
    Eigen::Vector4d q = pose.world_from_cam.rotation().coeffs();
    if (q.w() < 0) q = -q;
    char line[400];
    const int length =
        std::snprintf(line, sizeof(line), "%.9f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", pose.time,
                      t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
    if (length < 0 || static_cast<std::size_t>(length) >= sizeof(line) || !q.allFinite() ||
        !t.allFinite()) {
      throw std::logic_error("a pose of the trajectory is not finite");
    }
    text += line;
  }
  write_file(path, text);
}

}  // namespace hybrid_slam
