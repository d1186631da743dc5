#include "apps/feature_eval/study/tag_masks.h"

#include <cmath>
#include <numbers>

#include "frontend/input/text_file.h"

namespace hybrid_slam {
namespace {

// A tag's white border is one cell of its eight black ones wide, on each side (AprilTag's families
// of 36 bits, which have the widest code of those that TagSLAM takes).
constexpr double kWithBorder = 10.0 / 8;

}  // namespace

std::vector<Tag> read_tags(const std::filesystem::path& path) {
  std::vector<Tag> tags;
  for (const NumberRow& row : read_number_rows(path, ' ')) {
    const std::vector<double>& v = row.values;
    if (v.size() != 5 && v.size() != 9) throw line_error(path, row.line, "expected 5 or 9 numbers");
    if (!(v[1] > 0)) throw line_error(path, row.line, "a tag's size must be positive");
    tags.push_back({static_cast<int>(v[0]), v[1], {v[2], v[3], v[4]}});
  }
  return tags;
}

PixelBearings::PixelBearings(const Camera& camera)
    : width_(image_width(camera)), height_(image_height(camera)) {
  bearings_.reserve(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (int v = 0; v < height_; ++v) {
    for (int u = 0; u < width_; ++u) {
      const auto bearing = unproject(camera, Eigen::Vector2d(u, v));
      bearings_.push_back(bearing ? bearing->cast<float>() : Eigen::Vector3f::Zero().eval());
    }
  }
}

GrayImage PixelBearings::without_tags(const std::vector<Tag>& tags, const Rigid3d& world_from_cam,
                                      std::optional<GrayImage> mask) const {
  GrayImage image;
  if (mask) {
    image = std::move(*mask);
  } else {
    image = {width_, height_, std::vector<std::uint8_t>(bearings_.size(), 255)};
  }
  const Rigid3d cam_from_world = inverse(world_from_cam);
  for (const Tag& tag : tags) {
    const Eigen::Vector3d centre = cam_from_world * tag.centre_in_world;
    const double radius = kWithBorder * tag.size * std::numbers::sqrt2 / 2;
    const double distance = centre.norm();
    // The cone around the sphere through the tag's corners.
    const double cosine =
        distance > radius ? std::sqrt(1 - radius * radius / (distance * distance)) : -1;
    const Eigen::Vector3f axis = (centre / std::max(distance, 1e-12)).cast<float>();
    for (std::size_t i = 0; i < bearings_.size(); ++i) {
      if (bearings_[i].dot(axis) >= static_cast<float>(cosine)) image.pixels[i] = 0;
    }
  }
  return image;
}

}  // namespace hybrid_slam
