#include "frontend/matching/optical_flow.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "test/frontend/matching/blob_texture.h"
#include "test/support/motion_blur.h"

namespace hybrid_slam {
namespace {

constexpr int kFlowWidth = 320;
constexpr int kFlowHeight = 240;

std::vector<Eigen::Vector2f> flow_grid() {
  std::vector<Eigen::Vector2f> points;
  for (int y = 40; y < kFlowHeight - 40; y += 16) {
    for (int x = 50; x < kFlowWidth - 50; x += 16) {
      points.emplace_back(static_cast<float>(x), static_cast<float>(y));
    }
  }
  return points;
}

}  // namespace

TEST_CASE("Patches are followed into an image that is blurred by its motion") {
  std::mt19937_64 random(3);
  const BlobTexture texture(420, 340, random);
  const Eigen::Vector2d shift(23.4, -11.2);
  const auto at = [&](const Eigen::Vector2d& offset) {
    return texture.render(kFlowWidth, kFlowHeight, Eigen::Matrix2d::Identity(), offset, 1, 0, 2,
                          random);
  };
  const ImagePyramid before(at({50, 50}));
  const GrayImage moved = at(Eigen::Vector2d(50, 50) - shift);
  const std::vector<Eigen::Vector2f> points = flow_grid();
  for (const int blur : {1, 15}) {
    const auto found =
        follow_patches(before, ImagePyramid(blurred_along_rows(moved, blur)), points);
    CHECK(static_cast<double>(found.size()) > 0.7 * static_cast<double>(points.size()));
    std::vector<double> errors;
    for (const FlowMatch& match : found) {
      const Eigen::Vector2f& from = points[static_cast<std::size_t>(match.point)];
      errors.push_back((match.position - from - shift.cast<float>()).norm());
    }
    std::sort(errors.begin(), errors.end());
    CHECK(errors[errors.size() / 2] < (blur == 1 ? 0.1 : 0.7));
    CHECK(errors[errors.size() * 9 / 10] < (blur == 1 ? 0.3 : 2));
  }
}

TEST_CASE("Nothing is followed into an image that shows nothing of it") {
  std::mt19937_64 random(4);
  const BlobTexture texture(kFlowWidth, kFlowHeight, random),
      other(kFlowWidth, kFlowHeight, random);
  const auto image_of = [&](const BlobTexture& one) {
    return ImagePyramid(
        one.render(kFlowWidth, kFlowHeight, Eigen::Matrix2d::Identity(), {0, 0}, 1, 0, 2, random));
  };
  const ImagePyramid before = image_of(texture);
  const std::vector<Eigen::Vector2f> points = flow_grid();
  CHECK(follow_patches(before, image_of(other), points).size() < points.size() / 5);
  const GrayImage black{kFlowWidth, kFlowHeight,
                        std::vector<std::uint8_t>(std::size_t{kFlowWidth} * kFlowHeight, 0)};
  CHECK(follow_patches(before, ImagePyramid(black), points).empty());
  CHECK(follow_patches(before, before, {}).empty());
}

}  // namespace hybrid_slam
