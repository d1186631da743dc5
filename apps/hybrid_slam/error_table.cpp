#include "apps/hybrid_slam/error_table.h"

#include <fmt/format.h>

#include "cameras/files/output_file.h"

namespace hybrid_slam {

void write_errors(const std::filesystem::path& path, std::span<const ErrorsOfCamera> cameras,
                  const Sim3d& truth_from_estimate, double max_difference) {
  const Sim3d estimate_from_truth = inverse(truth_from_estimate);
  std::string text = "camera,time,error_m,true_x,true_y,true_z\n";
  for (const ErrorsOfCamera& camera : cameras) {
    for (const PosePair& pair : associate(camera.estimate, camera.truth, max_difference)) {
      const Eigen::Vector3d truth = pair.truth.translation();
      const Eigen::Vector3d aligned =
          truth_from_estimate * Eigen::Vector3d(pair.estimate.translation());
      const Eigen::Vector3d in_map = estimate_from_truth * truth;
      text += fmt::format("{},{:.9f},{:.9f},{:.9f},{:.9f},{:.9f}\n", camera.camera, pair.time,
                          (aligned - truth).norm(), in_map.x(), in_map.y(), in_map.z());
    }
  }
  write_file(path, text);
}

}  // namespace hybrid_slam
