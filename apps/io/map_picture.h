#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace hybrid_slam {

// What is drawn; all in one world frame [m] whose first camera looks along z, y down.
struct MapPicture {
  std::string title;
  std::vector<Eigen::Vector3d> points;     // landmarks
  std::vector<Eigen::Vector3d> path;       // the camera, in the order of time
  std::vector<Eigen::Vector3d> truth;      // aligned to the path; empty where there is none
  std::vector<Eigen::Vector3d> keyframes;  // positions of the camera
  // The same of the fisheye; empty where there is none.
  std::vector<Eigen::Vector3d> fisheye_points;  // landmarks that it found, not among `points`
  std::vector<Eigen::Vector3d> fisheye_path;
  std::vector<Eigen::Vector3d> fisheye_truth;
  std::vector<Eigen::Vector3d> fisheye_keyframes;
};

// Draws points and paths from above and from the side into one PNG. A path that leads forward is
// seen from above along y, one that leads sideways (a camera that looks down) along z. The view
// holds both paths and all but the outermost points. Throws OutputError; values that are not finite
// are left out.
void write_map_picture(const std::filesystem::path& path, const MapPicture& picture);

}  // namespace hybrid_slam
