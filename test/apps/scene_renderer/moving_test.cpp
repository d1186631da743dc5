#include <catch2/catch.hpp>

#include <cmath>

#include "apps/scene_renderer/arm.h"
#include "apps/scene_renderer/lamps.h"
#include "test/apps/scene_renderer/scene_matches.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const Calibrated<Pinhole> kSmallCamera{{107.3, 107.3, 63, 48.3}, 128, 96};

TEST_CASE("between frames the rig moves without jumps, at frames it is where it was") {
  for (const SceneKind kind : {SceneKind::kHybrid, SceneKind::kSurvey}) {
    const SceneOptions options = make_scene_options(kind, Difficulty::kNormal, 4, 60);
    const RayCaster flat(make_icosphere(2, Material::kGround, 0), 1);
    const RigMotion motion(options, flat);
    const auto frames = make_motion(options, flat);
    constexpr int kParts = 40;
    for (std::size_t i = 10; i < 14; ++i) {
      const Vector3d from = frames[i].world_from_left.translation();
      const Vector3d to = frames[i + 1].world_from_left.translation();
      CHECK(motion.at(frames[i].time).world_from_left.params == frames[i].world_from_left.params);
      Vector3d before = from;
      for (int k = 1; k <= kParts; ++k) {
        const double time = frames[i].time + k / (kParts * options.rate);
        const Vector3d now = motion.at(time).world_from_left.translation();
        CHECK((now - before).norm() < 4 * (to - from).norm() / kParts + 1e-4);
        before = now;
      }
      CHECK((before - to).norm() < 1e-9);
    }
  }
}

// Light of the green channel by row and column.
Eigen::ArrayXXd light_of(const ColorImage& image) {
  Eigen::ArrayXXd light(image.height, image.width);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const auto at = static_cast<std::size_t>(3 * (y * image.width + x) + 1);
      light(y, x) = std::pow(image.pixels[at] / 255.0, 2.2);
    }
  }
  return light;
}

double bilinear(const Eigen::ArrayXXd& light, double x, double y) {
  const auto column = static_cast<int>(std::floor(x)), row = static_cast<int>(std::floor(y));
  const double u = x - column, v = y - row;
  return (1 - v) * ((1 - u) * light(row, column) + u * light(row, column + 1)) +
         v * ((1 - u) * light(row + 1, column) + u * light(row + 1, column + 1));
}

TEST_CASE("blur is as long as the way of a known point during the exposure") {
  SceneOptions options = make_scene_options(SceneKind::kHybrid, Difficulty::kBlur, 3, 12);
  options.film.noise = 0;
  const SceneCameras cameras = make_scene_cameras(320, 240);
  const SceneSequence blurred(options, cameras, 2);
  options.conditions.exposure_time = 0;
  const SceneSequence sharp(options, cameras, 2);
  int frame = 0;
  for (int i = 1; i < 12; ++i) {
    if (blurred.ground_view(i).blur > blurred.ground_view(frame).blur) frame = i;
  }
  // The image's middle, on the ground, in the course of the exposure.
  const Camera camera = left_camera(blurred);
  const RigMotion motion(blurred.options(), blurred.seafloor());
  const double time = blurred.motion()[static_cast<std::size_t>(frame)].time;
  const Rigid3d pose = motion.at(time).world_from_left;
  const Vector3d ray = pose.rotation() * *unproject(camera, {159.5, 119.5});
  const auto hit = blurred.seafloor().cast(pose.translation().cast<float>(), ray.cast<float>());
  REQUIRE(hit);
  const Vector3d point = pose.translation() + hit->distance * ray;
  std::vector<Vector2d> way;
  for (int i = 0; i <= 100; ++i) {
    const Rigid3d then = motion.at(time + 0.1 * (i / 100.0 - 0.5)).world_from_left;
    way.push_back(*project(camera, inverse(then) * point) - Vector2d(159.5, 119.5));
  }
  double length = 0;
  for (std::size_t i = 1; i < way.size(); ++i) length += (way[i] - way[i - 1]).norm();
  REQUIRE(length > 3);
  REQUIRE(length < 30);
  CHECK(blurred.ground_view(frame).blur == Approx(length).epsilon(0.02));

  // The sharp picture smeared along the same way, but shorter or longer, is most like the blurred
  // one where it is as long.
  const Eigen::ArrayXXd soft = light_of(blurred.render(frame).left);
  const Eigen::ArrayXXd hard = light_of(sharp.render(frame).left);
  const auto difference = [&](double scale) {
    Eigen::ArrayXXd smeared(41, 41), there(41, 41);
    for (int y = 0; y < 41; ++y) {
      for (int x = 0; x < 41; ++x) {
        double sum = 0;
        for (const Vector2d& offset : way) {
          sum += bilinear(hard, 139 + x + scale * offset.x(), 99 + y + scale * offset.y());
        }
        smeared(y, x) = sum;
        there(y, x) = soft(99 + y, 139 + x);
      }
    }
    return (smeared / smeared.mean() - there / there.mean()).square().mean();
  };
  double best = 0;
  for (double scale = 0.2; scale < 2.01; scale += 0.05) {
    if (best == 0 || difference(scale) < difference(best)) best = scale;
  }
  CHECK(best == Approx(1).margin(0.11));
  // Depth and light differ a little over the patch: not all is explained.
  CHECK(difference(1) < 0.2 * difference(0));
}

TEST_CASE("the arm covers the share of the left image that is asked for") {
  for (const std::uint32_t seed : {1U, 3U}) {
    SceneOptions options = make_scene_options(SceneKind::kSurvey, Difficulty::kArm, seed, 24);
    options.width = 1;
    const SceneSequence sequence(options, make_scene_cameras(96, 72), 2);
    double share = 0;
    for (int i = 0; i < 24; i += 2) {
      const auto mask = sequence.render(i).arm[kLeft];
      REQUIRE(mask.size() == 96 * 72);
      for (const std::uint8_t seen : mask) share += seen / (12.0 * 96 * 72);
    }
    CHECK(share == Approx(0.3).margin(0.03));
  }
  // Wherever the wrist goes.
  const RayCaster flat(make_icosphere(2, Material::kGround, 0), 1);
  const ViewRays rays = make_view_rays(Camera(kSmallCamera), kPinholeHalfAngle, 2);
  for (std::uint32_t seed = 1; seed < 9; ++seed) {
    const auto motion =
        make_motion(make_scene_options(SceneKind::kHybrid, Difficulty::kArm, seed, 120), flat);
    const ArmShape arm = fit_arm(0.25, motion, rays);
    double share = 0;
    for (std::size_t i = 5; i < motion.size(); i += 10)
      share += arm_share(motion[i], arm, rays) / 12;
    INFO("seed " << seed);
    CHECK(share == Approx(0.25).margin(0.05));
  }
}

TEST_CASE("the arm's mask tells exactly the pixels that it changes, and its shadow only darkens") {
  SceneOptions options = make_scene_options(SceneKind::kHybrid, Difficulty::kArm, 3, 24);
  const SceneCameras cameras = make_scene_cameras(160, 120);
  const SceneSequence sequence(options, cameras, 2);
  const RigMoment& rig = sequence.motion()[6];
  const ViewRays rays = make_view_rays(sequence.stereo_lens(), kPinholeHalfAngle, 2);
  const RayCaster arm(make_arm(rig, {0.12F, 1}), 1);
  Lighting daylight;  // without lamps: no shadows
  const auto image_of = [&](const RayCaster* movers, const Lighting& lighting) {
    return render_view({&sequence.seafloor(), movers, lighting}, rays, rig.world_from_left, 9, 2);
  };
  const RadianceImage with = image_of(&arm, daylight), without = image_of(nullptr, daylight);
  REQUIRE(with.arm.size() == rays.bearing.size());
  CHECK(without.arm.empty());
  std::size_t masked = 0, same_in_mask = 0;
  for (std::size_t i = 0; i < with.arm.size(); ++i) {
    const bool same = (with.pixels[i] == without.pixels[i]).all();
    masked += with.arm[i];
    same_in_mask += with.arm[i] && same;
    if (!with.arm[i]) CHECK(same);
  }
  CHECK(masked > 500);
  CHECK(same_in_mask == 0);

  Lighting lit;
  lit.lamps = lamps_at(options, rig);
  const RadianceImage dark = image_of(&arm, lit), light = image_of(nullptr, lit);
  std::size_t darker = 0;
  for (std::size_t i = 0; i < dark.arm.size(); ++i) {
    if (dark.arm[i]) continue;
    CHECK((dark.pixels[i] <= light.pixels[i]).all());
    darker += dark.pixels[i][1] < 0.7F * light.pixels[i][1];
  }
  CHECK(darker > 100);
}

}  // namespace
}  // namespace hybrid_slam
