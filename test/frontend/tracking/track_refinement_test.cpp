#include "frontend/tracking/track_refinement.h"

#include <catch2/catch.hpp>
#include <random>

#include "backend/map/map.h"
#include "test/frontend/matching/blob_texture.h"

namespace hybrid_slam {
namespace {

constexpr int kWidth = 240;
constexpr int kHeight = 180;
constexpr double kFocal = 200;
constexpr double kDepth = 2;              // of a textured wall, parallel to the image
const Eigen::Vector2d kShift(5.3, -2.6);  // of the second image against the first [px]

Calibrated<RectifiedStereo> camera() {
  return {{kFocal, kFocal, 119.5, 89.5, 0.1}, kWidth, kHeight};
}

Frame wall_frame(std::int64_t index, const Eigen::Vector2d& shift, const BlobTexture& texture,
                 std::mt19937_64& random) {
  StereoFeatures features;
  features.left.kind = DescriptorKind::kSynthetic;
  for (int y = 30; y <= kHeight - 30; y += 20) {
    for (int x = 30; x <= kWidth - 30; x += 20) {
      Keypoint keypoint;
      keypoint.x = static_cast<float>(x + shift.x());
      keypoint.y = static_cast<float>(y + shift.y());
      keypoint.scale = 2;
      features.left.keypoints.push_back(keypoint);
      features.left.descriptors.emplace_back();
      features.u_right.push_back(keypoint.x - 10);  // 0.1 m * 200 px / 2 m
    }
  }
  Frame frame = make_frame(index, 0.1 * static_cast<double>(index), features, kWidth, kHeight);
  const Eigen::Vector2d offset = -shift;
  frame.image = std::make_shared<const ImagePyramid>(
      texture.render(kWidth, kHeight, Eigen::Matrix2d::Identity(), offset, 1, 0, 1, random));
  frame.cam_from_world = Rigid3d(Eigen::Quaterniond::Identity(),
                                 {shift.x() * kDepth / kFocal, shift.y() * kDepth / kFocal, 0});
  return frame;
}

// A wall seen by a keyframe (frame 0) and by a frame whose keypoints are off by half a pixel.
struct Wall {
  Wall() {
    std::mt19937_64 random(3);
    const BlobTexture texture(kWidth, kHeight, random);
    first = wall_frame(0, Eigen::Vector2d::Zero(), texture, random);
    second = wall_frame(1, kShift, texture, random);
    camera_id = map.add_camera(camera());
    auto observations = std::make_shared<FrameObservations>();
    observations->camera = camera_id;
    observations->features = first.features.left;
    observations->u_right = first.features.u_right;
    NewKeyframe keyframe{observations, Rigid3d(), {}, {}, {}};
    for (std::uint32_t i = 0; i < first.size(); ++i) {
      const Keypoint& k = first.features.left.keypoints[i];
      keyframe.new_points.emplace_back(
          i, *triangulate_stereo(camera(), {k.x, k.y, first.features.u_right[i]}));
    }
    second.landmarks = map.view().at(map.add_keyframe(keyframe)).landmarks;
    true_positions = second.features.left.keypoints;
    for (std::size_t i = 0; i < second.size(); ++i) {
      const float error = i % 2 == 0 ? 0.5F : -0.4F;
      second.features.left.keypoints[i].x += error;
      second.features.left.keypoints[i].y -= error;
      second.features.u_right[i] += error;
    }
  }

  Map map;
  CameraId camera_id;
  Frame first = make_frame(0, 0, {}, 1, 1);
  Frame second = first;
  std::vector<Keypoint> true_positions;
};

// Error of both coordinates after the refinement [px]; it was 0.64.
double refined_error(const TrackRefinementOptions& options) {
  Wall wall;
  TrackRefiner refiner(wall.camera_id, camera(), options);
  refiner.remember(wall.first);
  const auto before = wall.second.features;
  const int refined = refiner.refine(wall.map.view(), wall.second);
  CHECK(refined > 0.9 * static_cast<double>(wall.second.size()));
  double squares = 0;
  int moved = 0;
  for (std::size_t i = 0; i < wall.second.size(); ++i) {
    const Keypoint& now = wall.second.features.left.keypoints[i];
    const Keypoint& was = before.left.keypoints[i];
    CHECK(now.x - wall.second.features.u_right[i] ==
          Approx(was.x - before.u_right[i]).margin(1e-4));
    if (now.x == was.x) continue;
    ++moved;
    squares += std::pow(now.x - wall.true_positions[i].x, 2) +
               std::pow(now.y - wall.true_positions[i].y, 2);
    CHECK(now.sigma == Approx(TrackRefinementOptions().sigma));
  }
  CHECK(moved == refined);
  return std::sqrt(squares / moved);
}

TEST_CASE("Matched keypoints move to where their landmark's first view looks the same") {
  TrackRefinementOptions options;
  CHECK(refined_error(options) < std::sqrt(2.0) * 0.5 * options.sigma);  // half of what is promised
  options.alignment.half_size = 7;  // more texture, and more shading where lamps move
  CHECK(refined_error(options) < 0.05);
}

TEST_CASE("Without the image of a first view nothing moves") {
  Wall wall;
  const auto unchanged = [&](const TrackRefiner& refiner) {
    const std::vector<Keypoint> before = wall.second.features.left.keypoints;
    CHECK(refiner.refine(wall.map.view(), wall.second) == 0);
    for (std::size_t i = 0; i < before.size(); ++i) {
      CHECK(before[i].x == wall.second.features.left.keypoints[i].x);
    }
  };
  unchanged(TrackRefiner(wall.camera_id, camera(), {}));

  TrackRefinementOptions one;
  one.keyframes = 1;  // a later keyframe's image displaces the first one's
  TrackRefiner forgetful(wall.camera_id, camera(), one);
  forgetful.remember(wall.first);
  forgetful.remember(wall.second);
  unchanged(forgetful);

  TrackRefinementOptions off;
  off.enabled = false;
  TrackRefiner disabled(wall.camera_id, camera(), off);
  disabled.remember(wall.first);
  unchanged(disabled);
}

}  // namespace
}  // namespace hybrid_slam
