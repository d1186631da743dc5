#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "cameras/camera.h"
#include "cameras/geometry/rigid3d.h"
#include "frontend/features/image.h"

namespace hybrid_slam {

// A square tag (fiducial marker) that lies in the scene.
struct Tag {
  int id = 0;
  double size = 0;                  // side of its black square [m]
  Eigen::Vector3d centre_in_world;  // the world of the true poses
};

// Rows of "id size x y z", or of "id size x y z qw qx qy qz": a circle does not ask how the tag is
// turned. Throws InputError with file and line.
std::vector<Tag> read_tags(const std::filesystem::path& path);

// The bearings of a camera's pixels, found once for all its images.
class PixelBearings {
 public:
  explicit PixelBearings(const Camera& camera);

  // An image that is 0 where a pixel's ray passes within the circle around a tag, its white border
  // included, and 255 elsewhere; `mask`: zero pixels of which stay so.
  GrayImage without_tags(const std::vector<Tag>& tags, const Rigid3d& world_from_cam,
                         std::optional<GrayImage> mask) const;

 private:
  int width_ = 0, height_ = 0;
  std::vector<Eigen::Vector3f> bearings_;  // zero where no ray has the pixel
};

}  // namespace hybrid_slam
