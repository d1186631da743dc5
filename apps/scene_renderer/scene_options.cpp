#include "apps/scene_renderer/scene_options.h"

#include <cmath>

#include "apps/scene_renderer/noise.h"

namespace hybrid_slam {
namespace {

constexpr double kSpellLength = 3;  // [s] of the presets' silt and darkness

// Clear water, nothing in it.
void make_easy(SceneOptions& options) {
  options.water.attenuation = {0.2F, 0.08F, 0.06F};
  options.water.scattering = {0.012F, 0.014F, 0.015F};
  options.snow.density = 0;
  options.film.noise = 0.8F;
  options.film.blur = 0.45F;
  options.sway = 0.6;
}

void make_hard(SceneOptions& options) {
  options.water.attenuation = {0.52F, 0.33F, 0.3F};
  options.water.scattering = {0.08F, 0.095F, 0.1F};
  options.snow.density = 900;
  options.snow.largest_radius = 0.0014F;
  options.film.noise = 2.6F;
  options.film.blur = 0.75F;
  options.fish = 7;
  options.sway = 1.6;
  options.silt_episodes = options.kind == SceneKind::kHybrid;
  options.turned_away = options.kind == SceneKind::kHybrid;
}

// One hardship each, in the water of the preset easy.
void make_condition(SceneOptions& options) {
  Conditions& conditions = options.conditions;
  const Spell spell{std::round(0.4 * options.frames / options.rate), kSpellLength};
  switch (options.difficulty) {
    case Difficulty::kSand:
      conditions.ground = Ground::kSand;
      break;
    case Difficulty::kLowLight:
      conditions.photons = 400;
      conditions.read_noise = 3;
      conditions.exposure_bias = -1.5;
      break;
    case Difficulty::kBlur:
      conditions.exposure_time = 0.1;
      conditions.shake = 1.5;
      break;
    case Difficulty::kSilt:
      conditions.silt = {spell};
      break;
    case Difficulty::kLampsOff:
      conditions.lamps_off = {spell};
      break;
    case Difficulty::kArm:
      conditions.arm = 30;
      break;
    default:
      break;
  }
}

}  // namespace

const std::map<std::string, SceneKind>& scene_kinds() {
  static const std::map<std::string, SceneKind> kinds{{"hybrid", SceneKind::kHybrid},
                                                      {"survey", SceneKind::kSurvey}};
  return kinds;
}

const std::map<std::string, Difficulty>& difficulties() {
  static const std::map<std::string, Difficulty> names{{"easy", Difficulty::kEasy},
                                                       {"normal", Difficulty::kNormal},
                                                       {"hard", Difficulty::kHard},
                                                       {"sand", Difficulty::kSand},
                                                       {"low-light", Difficulty::kLowLight},
                                                       {"blur", Difficulty::kBlur},
                                                       {"silt", Difficulty::kSilt},
                                                       {"lamps-off", Difficulty::kLampsOff},
                                                       {"arm", Difficulty::kArm}};
  return names;
}

SceneOptions make_scene_options(SceneKind kind, Difficulty difficulty, std::uint32_t seed,
                                std::optional<int> frames) {
  SceneOptions options;
  options.kind = kind;
  options.difficulty = difficulty;
  options.seed = seed;
  options.frames = frames.value_or(kind == SceneKind::kHybrid ? 120 : 400);
  options.rate = kind == SceneKind::kHybrid ? 3 : 5;
  if (difficulty == Difficulty::kHard) {
    make_hard(options);
  } else if (difficulty != Difficulty::kNormal) {
    make_easy(options);
    make_condition(options);
  }
  return options;
}

std::uint32_t visit_seed(const SceneOptions& options) {
  if (options.visit == 0) return options.seed;
  return mixed_bits(static_cast<std::int32_t>(options.visit), 0, 29, options.seed);
}

SceneCameras make_scene_cameras(int stereo_width, int stereo_height) {
  const double scale = stereo_width / 1024.0;
  const double middle = 0.5 * (stereo_width - 1);
  SceneCameras cameras;
  const double focal = 858.35 * scale;
  cameras.stereo = {
      {focal, focal, middle - 4.3 * scale, 0.5 * (stereo_height - 1) + 6.2 * scale, 0.15},
      stereo_width,
      stereo_height};
  cameras.fisheye = {{318.52 * scale, 318.21 * scale, middle + 3.4 * scale, middle - 2.9 * scale,
                      0.0123, -0.0212, 0.0134, -0.0036},
                     stereo_width,
                     stereo_width};
  return cameras;
}

}  // namespace hybrid_slam
