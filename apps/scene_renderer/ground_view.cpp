#include <algorithm>
#include <cmath>

#include "apps/scene_renderer/sequence.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3d;

constexpr float kSeenGround = 4;  // [m] what lies farther away hardly shows

}  // namespace

CommonView SceneSequence::common_view(int frame) const {
  const RigMoment& rig = motion_[static_cast<std::size_t>(frame)];
  const Rigid3d fish_from_world = inverse(*rig.world_from_fish);
  const Lighting lighting = lighting_at(rig);
  const Eigen::Vector3f eye = rig.world_from_fish->translation().cast<float>();
  int surfaces = 0, in_view = 0;
  double through = 0;
  for (int y = 8; y < cameras_.stereo.height; y += cameras_.stereo.height / 12) {
    for (int x = 8; x < cameras_.stereo.width; x += cameras_.stereo.width / 16) {
      const auto bearing = hybrid_slam::unproject(stereo_.lens.calibrated(), {x, y});
      const Eigen::Vector3f ray = (rig.world_from_left.rotation() * *bearing).cast<float>();
      const Eigen::Vector3f left = rig.world_from_left.translation().cast<float>();
      const auto hit = seafloor_.cast(left, ray);
      if (!hit || hit->distance > kSeenGround) continue;
      ++surfaces;
      const Eigen::Vector3f point = left + hit->distance * ray;
      const Vector3d in_fish = fish_from_world * point.cast<double>();
      const auto pixel = project(cameras_.fisheye, in_fish);
      const double angle = std::atan2(in_fish.head<2>().norm(), in_fish.z());
      if (!pixel || angle > kFisheyeHalfAngle || seafloor_.is_blocked(point, eye, 0.01F)) continue;
      ++in_view;
      double extinction = 0;  // of the silt between, by the middles of ten steps
      for (int i = 0; i < 10; ++i) {
        const float share = (static_cast<float>(i) + 0.5F) / 10;
        extinction += 0.1 * in_fish.norm() * silt_at(lighting.silt, eye + share * (point - eye));
      }
      through += std::exp(-extinction);
    }
  }
  CommonView view;
  if (surfaces > 0) view.in_view = static_cast<double>(in_view) / surfaces;
  if (in_view > 0) view.visible = through / in_view;
  return view;
}

GroundView SceneSequence::ground_view(int frame) const {
  constexpr int kColumns = 16, kRows = 12, kSteps = 24;
  constexpr float kSiltReach = 1.4F;  // [m] ahead of the cameras, beyond which there is no cloud
  const FrameFate& fate = fates_[static_cast<std::size_t>(frame)];
  const RigMoment rig = rig_motion_.at(fate.picture / options_.rate);
  GroundView view;
  if (arm_.thickness > 0) view.arm = arm_share(rig, arm_, stereo_.rays);
  const Eigen::Vector2d middle(0.5 * (stereo_.rays.width - 1), 0.5 * (stereo_.rays.height - 1));
  view.blur = image_way(kLeft, rig.time, middle);
  if (!options_.conditions.lamps_on(rig.time)) return view;
  Scenes scenes;
  const Scene& scene = scene_at(rig.time, scenes);
  const Eigen::Vector3f eye = rig.world_from_left.translation().cast<float>();
  const Eigen::Quaternionf rotation = rig.world_from_left.rotation().cast<float>();
  int grounds = 0;
  double through = 0;
  for (int i = 0; i < kColumns * kRows; ++i) {
    const int x = (2 * (i % kColumns) + 1) * stereo_.rays.width / (2 * kColumns);
    const int y = (2 * (i / kColumns) + 1) * stereo_.rays.height / (2 * kRows);
    const auto pixel = static_cast<std::size_t>(y * stereo_.rays.width + x);
    const Eigen::Vector3f ray = rotation * stereo_.rays.bearing[pixel];
    const auto ground = seafloor_.cast(eye, ray);
    if (!ground || ground->distance > kSeenGround) continue;
    ++grounds;
    const Eigen::Vector3f point = eye + ground->distance * ray;
    if (scene.movers && scene.movers->is_blocked(eye, point, 1e-3F)) continue;
    const float step = std::min(kSiltReach, ground->distance) / kSteps;
    float extinction = 0;
    for (int k = 0; k < kSteps; ++k) {
      extinction += step * silt_at(scene.moment.lighting.silt,
                                   eye + (static_cast<float>(k) + 0.5F) * step * ray);
    }
    through += std::exp(-extinction);
  }
  if (grounds > 0) view.visible = through / grounds;
  return view;
}

}  // namespace hybrid_slam
