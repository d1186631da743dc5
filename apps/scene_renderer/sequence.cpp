#include "apps/scene_renderer/sequence.h"

#include <algorithm>
#include <cmath>

#include "apps/scene_renderer/lamps.h"
#include "apps/scene_renderer/noise.h"
#include "apps/scene_renderer/port_dirt.h"
#include "apps/scene_renderer/relief.h"

namespace hybrid_slam {
namespace {

using Eigen::Vector3d;

ReliefOptions relief_options(const SceneOptions& options) {
  ReliefOptions relief;
  if (options.conditions.ground == Ground::kSand) {
    relief.roughness = 0.05F;
    relief.mound_height = 0.08F;
    relief.ripple_height = 0.018F;
  }
  if (options.kind == SceneKind::kSurvey) {
    const auto reach = static_cast<float>(survey_radius(options)) + 1.2F;
    relief.boulder_area = reach;
    relief.detailed_size = 0.75F * reach;
    relief.half_size = reach + 5;
    relief.grid = std::clamp(static_cast<int>(240 * reach), 640, 1600);
    relief.boulders = static_cast<int>(22 * reach * reach);
    relief.mound_height = std::min(relief.mound_height, 0.15F);
  }
  if (options.conditions.ground == Ground::kSand) relief.boulders = 0;
  return relief;
}

// A cloud that hides what lies ahead of a camera.
SiltCloud cloud_at(const Vector3d& centre, float strength, float radius, std::uint32_t seed) {
  SiltCloud cloud;
  cloud.centre = centre.cast<float>();
  cloud.extinction = 40 * strength;
  cloud.radius = radius;
  cloud.seed = seed;
  return cloud;
}

void add_snapshot(const RadianceImage& image, RadianceImage& sum) {
  for (std::size_t i = 0; i < sum.pixels.size(); ++i) sum.pixels[i] += image.pixels[i];
  for (std::size_t i = 0; i < sum.arm.size(); ++i) sum.arm[i] |= image.arm[i];
}

}  // namespace

SceneSequence::SceneSequence(const SceneOptions& options, const SceneCameras& cameras, int threads)
    : options_(options),
      cameras_(cameras),
      threads_(threads),
      seafloor_(make_seafloor(relief_options(options), options.seed, threads), threads),
      rig_motion_(options, seafloor_),
      fates_(frame_fates(options.conditions, options.frames, visit_seed(options))),
      film_(options.film) {
  const Conditions& conditions = options.conditions;
  for (const FrameFate& fate : fates_) {
    motion_.push_back(rig_motion_.at(fate.moment / options.rate));
  }
  const auto& [fx, fy, cx, cy, baseline] = cameras.stereo.params;
  const Calibrated<Pinhole> pinhole{{fx, fy, cx, cy}, cameras.stereo.width, cameras.stereo.height};
  stereo_.lens = Lens(pinhole, conditions.miscalibration);
  stereo_.rays = make_view_rays(stereo_.lens, kPinholeHalfAngle, threads);
  if (options.kind == SceneKind::kHybrid) {
    fisheye_.lens = cameras.fisheye;
    fisheye_.rays = make_view_rays(fisheye_.lens, kFisheyeHalfAngle, threads);
  }
  for (const ViewNumber view : {kLeft, kRight, kFish}) {
    const ViewRays& rays = optics_of(view).rays;
    if (conditions.dirt > 0 && rays.width > 0) {
      dirt_[view] =
          make_dirt(rays, conditions.dirt / 100, mixed_bits(view, 0, 19, visit_seed(options)));
    }
  }
  if (conditions.arm > 0) {
    arm_ = fit_arm(conditions.arm / 100, motion_, stereo_.rays);
  }
  film_.photons = static_cast<float>(conditions.photons);
  film_.read_noise = static_cast<float>(conditions.read_noise);
}

Rigid3d SceneSequence::world_from_right(const RigMoment& moment) const {
  const Miscalibration& errors = options_.conditions.miscalibration;
  const Rigid3d& left = moment.world_from_left;
  const Vector3d place = left * Vector3d(cameras_.stereo.params[4], 0, 0);
  if (errors == Miscalibration{}) return {left.rotation(), place};
  return {left.rotation() * right_turn(errors), place};
}

Rigid3d SceneSequence::pose_of(ViewNumber view, const RigMoment& rig) const {
  return view == kLeft    ? rig.world_from_left
         : view == kRight ? world_from_right(rig)
                          : *rig.world_from_fish;
}

std::uint32_t SceneSequence::seed_of(int number, ViewNumber view) const {
  return mixed_bits(number, view, 17, visit_seed(options_));
}

Lighting SceneSequence::lighting_at(const RigMoment& moment) const {
  const Conditions& conditions = options_.conditions;
  Lighting lighting;
  lighting.water = options_.water;
  if (!conditions.lamps_off.empty()) lighting.water.ambient.setZero();
  if (conditions.lamps_on(moment.time)) lighting.lamps = lamps_at(options_, moment);
  const auto everywhere = static_cast<float>(conditions.silt_at(moment.time));
  const float at_fish = std::max(moment.silt, everywhere);
  if (moment.world_from_fish && at_fish > 0) {
    lighting.silt.push_back(cloud_at(*moment.world_from_fish * Vector3d(0, 0, 0.08), at_fish, 0.26F,
                                     visit_seed(options_) + 3));
  }
  if (everywhere > 0) {
    lighting.silt.push_back(cloud_at(moment.world_from_left * Vector3d(0.075, 0, 0.35), everywhere,
                                     0.35F, visit_seed(options_) + 5));
  }
  return lighting;
}

const SceneSequence::Scene& SceneSequence::scene_at(double time, Scenes& scenes) const {
  if (const auto known = scenes.find(time); known != scenes.end()) return known->second;
  Scene& scene = scenes[time];
  scene.rig = rig_motion_.at(time);
  TriangleMesh movers;
  if (options_.fish > 0) movers = make_fish(options_.fish, time, visit_seed(options_));
  if (arm_.thickness > 0) movers.append(make_arm(scene.rig, arm_));
  if (!movers.triangles.empty()) scene.movers = std::make_unique<RayCaster>(std::move(movers), 1);
  scene.moment = {&seafloor_, scene.movers.get(), lighting_at(scene.rig)};
  return scene;
}

// How far the ground that a pixel shows moves in the image during the exposure [px].
double SceneSequence::image_way(ViewNumber view, double time, const Eigen::Vector2d& pixel) const {
  constexpr int kSteps = 8;
  constexpr float kDistance = 2;  // [m] of what is seen where there is no ground
  const Lens& lens = optics_of(view).lens;
  const auto ray = lens.unproject(pixel);
  if (!ray) return 0;
  const Rigid3d middle = pose_of(view, rig_motion_.at(time));
  const Vector3d direction = middle.rotation() * ray->bearing;
  const auto hit = seafloor_.cast(middle.translation().cast<float>(), direction.cast<float>());
  const Vector3d point = middle.translation() + (hit ? hit->distance : kDistance) * direction;
  const auto place_at = [&](int step) {
    const double at = time + options_.conditions.exposure_time * (step / double{kSteps} - 0.5);
    return lens.project(inverse(pose_of(view, rig_motion_.at(at))) * point).value_or(pixel);
  };
  double way = 0;
  for (int i = 0; i < kSteps; ++i) way += (place_at(i + 1) - place_at(i)).norm();
  return way;
}

// Enough that the image moves by about a pixel from one to the next.
int SceneSequence::snapshots_for(ViewNumber view, double time) const {
  constexpr int kMost = 64;
  if (options_.conditions.exposure_time == 0) return 1;
  const ViewRays& rays = optics_of(view).rays;
  double way = 0;
  for (const double x : {0.2, 0.5, 0.8}) {
    for (const double y : {0.2, 0.5, 0.8}) {
      way = std::max(way, image_way(view, time, {x * rays.width, y * rays.height}));
    }
  }
  return std::clamp(static_cast<int>(std::ceil(way)), 1, kMost);
}

RadianceImage SceneSequence::snapshot(ViewNumber view, const Scene& scene,
                                      std::uint32_t seed) const {
  const auto& [lens, rays] = optics_of(view);
  const Rigid3d world_from_cam = pose_of(view, scene.rig);
  RadianceImage image = render_view(scene.moment, rays, world_from_cam, seed, threads_);
  if (options_.snow.density > 0) {
    draw_snow(options_.snow, scene.moment, lens, rays, world_from_cam, scene.rig.time,
              visit_seed(options_), image);
  }
  return image;
}

RadianceImage SceneSequence::expose(ViewNumber view, const RigMoment& rig, Scenes& scenes) const {
  const Conditions& conditions = options_.conditions;
  const double time = rig.time + (view == kRight ? conditions.right_late / 1000 : 0);
  const int count = snapshots_for(view, time);
  const std::uint32_t seed = seed_of(rig.number, view);
  RadianceImage image;
  for (int i = 0; i < count; ++i) {
    const double at = time + conditions.exposure_time * ((i + 0.5) / count - 0.5);
    const Scene& scene = scene_at(at, scenes);
    RadianceImage next = snapshot(view, scene, i == 0 ? seed : mixed_bits(i, 3, 23, seed));
    if (i == 0) {
      image = std::move(next);
    } else {
      add_snapshot(next, image);
    }
  }
  if (count > 1) {
    for (Color& pixel : image.pixels) pixel /= static_cast<float>(count);
  }
  if (!dirt_[view].empty()) apply_dirt(dirt_[view], image);
  return image;
}

RenderedFrame SceneSequence::render(int frame) const {
  const FrameFate& fate = fates_[static_cast<std::size_t>(frame)];
  const RigMoment rig = rig_motion_.at(fate.picture / options_.rate);
  Scenes scenes;
  const float factor = exposure_factor(options_.conditions, rig.time, visit_seed(options_));
  const auto picture_of = [&](const RadianceImage& image, float exposure, ViewNumber view) {
    return develop(image, optics_of(view).rays, factor * exposure, film_, seed_of(rig.number, view),
                   threads_);
  };
  RadianceImage left = expose(kLeft, rig, scenes);
  RadianceImage right = expose(kRight, rig, scenes);
  const float exposure = exposure_for(left, stereo_.rays, film_);  // one for the pair
  RenderedFrame images{picture_of(left, exposure, kLeft),
                       picture_of(right, exposure, kRight),
                       std::nullopt,
                       {std::move(left.arm), std::move(right.arm)}};
  if (rig.world_from_fish) {
    RadianceImage wide = expose(kFish, rig, scenes);
    images.fish = picture_of(wide, exposure_for(wide, fisheye_.rays, film_), kFish);
    images.arm[kFish] = std::move(wide.arm);
  }
  return images;
}

}  // namespace hybrid_slam
