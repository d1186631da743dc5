#include "frontend/odometry/left_motion.h"

#include <cmath>

#include <Eigen/Cholesky>

#include <catch2/catch.hpp>

#include "backend/map/frame_observations.h"
#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"
#include "test/frontend/matching/blob_texture.h"
#include "test/frontend/pose/pose_scene.h"
#include "test/support/motion_blur.h"
#include "test/support/random.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

StereoFeatures without_right(StereoFeatures features) {
  std::fill(features.u_right.begin(), features.u_right.end(), kNoRightMatch);
  std::fill(features.right_of_left.begin(), features.right_of_left.end(), -1);
  return features;
}

double normalized_error(const StereoMotion& motion, const Rigid3d& truth) {
  const Vector6d off = se3_log(truth * inverse(motion.current_from_previous));
  return squared_mahalanobis(off, motion.covariance) / 6;
}

SyntheticScene scene_of(SceneTrajectory trajectory, std::uint64_t seed) {
  SyntheticSceneOptions options;
  options.trajectory = trajectory;
  options.times = 5;
  options.landmarks = 600;
  options.noise = 0.1;
  options.clutter = 200;
  options.seed = seed;
  return make_synthetic_scene(options);
}

// A plane straight ahead, of which two pictures are taken that are shifted against each other.
struct Wall {
  Calibrated<RectifiedStereo> camera{{300, 300, 160, 120, 0.1}, 320, 240};
  double depth = 2;     // [m]
  double shift = 18.5;  // [px] to the right
  std::mt19937_64 random{5};
  BlobTexture texture{420, 340, random};
  StereoFeatures features;
  Rigid3d truth{Eigen::Quaterniond::Identity(), {shift * depth / 300, 0, 0}};

  Wall() {
    const double disparity = 300 * 0.1 / depth;
    for (int y = 40; y < 200; y += 12) {
      for (int x = 60; x < 260; x += 12) {
        Keypoint keypoint;
        keypoint.x = static_cast<float>(x);
        keypoint.y = static_cast<float>(y);
        keypoint.sigma = 0.3F;
        features.left.keypoints.push_back(keypoint);
        features.left.descriptors.emplace_back();
        features.u_right.push_back(static_cast<float>(x - disparity));
      }
    }
  }

  GrayImage image(double moved) {
    return texture.render(320, 240, Eigen::Matrix2d::Identity(), {50 - moved, 50}, 1, 0, 2, random);
  }
};

TEST_CASE("Matches of the left image alone tell the motion, and how certain it is") {
  for (const SceneTrajectory trajectory : {SceneTrajectory::kCorridor, SceneTrajectory::kHover}) {
    double sum = 0;
    constexpr int kRuns = 40;
    for (int run = 0; run < kRuns; ++run) {
      const SyntheticScene scene = scene_of(trajectory, static_cast<std::uint64_t>(1 + run));
      const auto& camera = std::get<Calibrated<RectifiedStereo>>(scene.cameras[0]);
      const auto motion =
          motion_by_left_matches(camera, stereo_features(*scene.frames[3].observations),
                                 without_right(stereo_features(*scene.frames[4].observations)));
      REQUIRE(motion);
      CHECK(is_believed(motion->support));
      CHECK(motion->inliers.size() > 50);
      CHECK(motion->patches == 0);
      const Rigid3d truth =
          scene.frames[4].cam_from_world * inverse(scene.frames[3].cam_from_world);
      sum += normalized_error(*motion, truth);
    }
    INFO("trajectory " << static_cast<int>(trajectory));
    CHECK(sum / kRuns > 0.5);
    CHECK(sum / kRuns < 1.5);
  }
}

TEST_CASE("Left matches between two places are not believed") {
  for (std::uint64_t seed = 1; seed < 6; ++seed) {
    const SyntheticScene here = scene_of(SceneTrajectory::kHover, seed);
    const SyntheticScene there = scene_of(SceneTrajectory::kHover, seed + 100);
    const auto motion =
        motion_by_left_matches(std::get<Calibrated<RectifiedStereo>>(here.cameras[0]),
                               stereo_features(*here.frames[3].observations),
                               stereo_features(*there.frames[4].observations));
    CHECK_FALSE((motion && is_believed(motion->support)));
  }
}

// Fourteen keypoints that are found again where a wrong motion leads, among thirty that are not.
struct Ribs {
  Calibrated<RectifiedStereo> camera{{300, 300, 160, 120, 0.1}, 320, 240};
  StereoFeatures before, after;

  // `spread` [px]: the side of the square that they lie in.
  explicit Ribs(double spread) {
    Random random(3);
    const Rigid3d wrong(Eigen::Quaterniond::Identity(), {0.4, 0, 0});
    for (int i = 0; i < 44; ++i) {
      const bool rib = i < 14;
      const double u = rib ? 60 + random.uniform(0, spread) : random.uniform(0, 320);
      const double v = rib ? 20 + random.uniform(0, spread) : random.uniform(0, 240);
      const double depth = random.uniform(2, 5);
      const Eigen::Vector3d point((u - 160) / 300 * depth, (v - 120) / 300 * depth, depth);
      const Eigen::Vector3d moved = wrong * point;
      add(before, u, v, u - 300 * 0.1 / depth, i);
      if (rib) {
        add(after, 300 * moved.x() / moved.z() + 160 + 0.2 * random.gaussian(),
            300 * moved.y() / moved.z() + 120 + 0.2 * random.gaussian(), kNoRightMatch, i);
      } else {
        add(after, random.uniform(0, 320), random.uniform(0, 240), kNoRightMatch, i);
      }
    }
  }

  static void add(StereoFeatures& features, double u, double v, double u_right, int i) {
    features.left.keypoints.push_back(
        {.x = static_cast<float>(u), .y = static_cast<float>(v), .scale = 4, .sigma = 0.5F});
    Descriptor descriptor{};
    descriptor[static_cast<std::size_t>(i)] = 255;
    features.left.descriptors.push_back(descriptor);
    features.u_right.push_back(static_cast<float>(u_right));
    features.right_of_left.push_back(-1);
  }
};

TEST_CASE("Many matches at one place are little evidence") {
  const auto motion_of = [](const Ribs& ribs) {
    return motion_by_left_matches(ribs.camera, ribs.before, ribs.after);
  };
  const auto all_over = motion_of(Ribs(180));
  REQUIRE(all_over);
  CHECK(all_over->support.inliers >= 14);
  CHECK(is_no_accident(all_over->support));
  const auto at_one_place = motion_of(Ribs(40));
  REQUIRE(at_one_place);
  CHECK(at_one_place->support.inliers >= 14);
  CHECK(at_one_place->support.evidence <= 4);
  CHECK_FALSE(is_no_accident(at_one_place->support));
}

TEST_CASE("Patches tell the motion into a blurred image, and nothing of a black one") {
  Wall wall;
  const ImagePyramid before(wall.image(0));
  for (const int blur : {1, 15}) {
    const ImagePyramid after(blurred_along_rows(wall.image(wall.shift), blur));
    const auto motion = motion_by_patches(wall.camera, wall.features, before, after);
    REQUIRE(motion);
    CHECK(is_believed(motion->support));
    CHECK(motion->inliers.empty());
    CHECK(motion->patches == motion->support.inliers);
    CHECK(pose_scene::translation_error(motion->current_from_previous, wall.truth) <
          (blur == 1 ? 0.01 : 0.04));
    // The error is that of the image, not of patches one by one: within three sigma.
    CHECK(normalized_error(*motion, wall.truth) < 9. / 6 * 3);
  }
  const GrayImage black{320, 240, std::vector<std::uint8_t>(320 * 240, 0)};
  CHECK_FALSE(motion_by_patches(wall.camera, wall.features, before, ImagePyramid(black)));
}

}  // namespace
}  // namespace hybrid_slam
