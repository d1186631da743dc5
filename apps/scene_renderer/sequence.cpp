#include "apps/scene_renderer/sequence.h"

#include <algorithm>
#include <cmath>

#include "apps/scene_renderer/lamps.h"
#include "apps/scene_renderer/noise.h"
#include "apps/scene_renderer/relief.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3d;

enum ViewNumber { kLeft, kRight, kFish };

ReliefOptions relief_options(const SceneOptions& options) {
  ReliefOptions relief;
  if (options.kind == SceneKind::kSurvey) {
    const auto reach = static_cast<float>(survey_radius(options)) + 1.2F;
    relief.boulder_area = reach;
    relief.detailed_size = 0.75F * reach;
    relief.half_size = reach + 5;
    relief.grid = std::clamp(static_cast<int>(240 * reach), 640, 1600);
    relief.boulders = static_cast<int>(22 * reach * reach);
    relief.mound_height = 0.15F;
  }
  return relief;
}

Rigid3d right_of(const Rigid3d& world_from_left, double baseline) {
  return {world_from_left.rotation(), world_from_left * Vector3d(baseline, 0, 0)};
}

}  // namespace

SceneSequence::SceneSequence(const SceneOptions& options, const SceneCameras& cameras, int threads)
    : options_(options),
      cameras_(cameras),
      threads_(threads),
      seafloor_(make_seafloor(relief_options(options), options.seed, threads), threads),
      motion_(make_motion(options, seafloor_)) {
  const auto& [fx, fy, cx, cy, baseline] = cameras.stereo.params;
  pinhole_ = Calibrated<Pinhole>{{fx, fy, cx, cy}, cameras.stereo.width, cameras.stereo.height};
  stereo_rays_ = make_view_rays(pinhole_, kPinholeHalfAngle, threads);
  if (options.kind == SceneKind::kHybrid) {
    fisheye_rays_ = make_view_rays(cameras.fisheye, kFisheyeHalfAngle, threads);
  }
}

std::uint32_t SceneSequence::seed_of(int frame, int view) const {
  return mixed_bits(frame, view, 17, visit_seed(options_));
}

Lighting SceneSequence::lighting_at(const RigMoment& moment) const {
  Lighting lighting;
  lighting.water = options_.water;
  lighting.lamps = lamps_at(options_, moment);
  if (moment.silt > 0) {
    SiltCloud cloud;
    cloud.centre = (*moment.world_from_fish * Vector3d(0, 0, 0.08)).cast<float>();
    cloud.extinction = 40 * moment.silt;
    cloud.radius = 0.26F;
    cloud.seed = visit_seed(options_) + 3;
    lighting.silt.push_back(cloud);
  }
  return lighting;
}

RadianceImage SceneSequence::expose(const SceneMoment& moment, const Camera& camera,
                                    const ViewRays& rays, const Rigid3d& world_from_cam,
                                    double time, int frame, int view) const {
  RadianceImage image = render_view(moment, rays, world_from_cam, seed_of(frame, view), threads_);
  if (options_.snow.density > 0) {
    draw_snow(options_.snow, moment, camera, rays, world_from_cam, time, visit_seed(options_),
              image);
  }
  return image;
}

RenderedFrame SceneSequence::render(int frame) const {
  const RigMoment& rig = motion_[static_cast<std::size_t>(frame)];
  std::unique_ptr<RayCaster> fish;
  if (options_.fish > 0) {
    fish = std::make_unique<RayCaster>(make_fish(options_.fish, rig.time, visit_seed(options_)), 1);
  }
  const SceneMoment moment{&seafloor_, fish.get(), lighting_at(rig)};
  const auto picture_of = [&](const RadianceImage& image, const ViewRays& rays, float exposure,
                              int view) {
    return develop(image, rays, exposure, options_.film, seed_of(frame, view), threads_);
  };
  const double baseline = cameras_.stereo.params[4];
  const RadianceImage left =
      expose(moment, pinhole_, stereo_rays_, rig.world_from_left, rig.time, frame, kLeft);
  const RadianceImage right =
      expose(moment, pinhole_, stereo_rays_, right_of(rig.world_from_left, baseline), rig.time,
             frame, kRight);
  const float exposure = exposure_for(left, stereo_rays_, options_.film);  // one for the pair
  RenderedFrame images{picture_of(left, stereo_rays_, exposure, kLeft),
                       picture_of(right, stereo_rays_, exposure, kRight), std::nullopt};
  if (rig.world_from_fish) {
    const RadianceImage wide = expose(moment, cameras_.fisheye, fisheye_rays_, *rig.world_from_fish,
                                      rig.time, frame, kFish);
    images.fish =
        picture_of(wide, fisheye_rays_, exposure_for(wide, fisheye_rays_, options_.film), kFish);
  }
  return images;
}

CommonView SceneSequence::common_view(int frame) const {
  const RigMoment& rig = motion_[static_cast<std::size_t>(frame)];
  const Rigid3d fish_from_world = inverse(*rig.world_from_fish);
  const Lighting lighting = lighting_at(rig);
  const Eigen::Vector3f eye = rig.world_from_fish->translation().cast<float>();
  int surfaces = 0, in_view = 0;
  double through = 0;
  for (int y = 8; y < cameras_.stereo.height; y += cameras_.stereo.height / 12) {
    for (int x = 8; x < cameras_.stereo.width; x += cameras_.stereo.width / 16) {
      const auto bearing = unproject(pinhole_, {x, y});
      const Eigen::Vector3f ray = (rig.world_from_left.rotation() * *bearing).cast<float>();
      const Eigen::Vector3f left = rig.world_from_left.translation().cast<float>();
      const auto hit = seafloor_.cast(left, ray);
      if (!hit || hit->distance > 4) continue;
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

}  // namespace hybrid_slam
