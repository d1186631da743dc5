#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "apps/scene_renderer/conditions.h"
#include "apps/scene_renderer/drifting.h"
#include "apps/scene_renderer/film.h"
#include "apps/scene_renderer/water.h"
#include "cameras/camera.h"

namespace hybrid_slam {

enum class SceneKind { kHybrid, kSurvey };
enum class Difficulty { kEasy, kNormal, kHard, kSand, kLowLight, kBlur, kSilt, kLampsOff, kArm };

// What is rendered, and how hard it is made. Equal options give equal bytes.
struct SceneOptions {
  SceneKind kind = SceneKind::kHybrid;
  Difficulty difficulty = Difficulty::kNormal;
  std::uint32_t seed = 0;
  // Another visit to the seafloor that `seed`, `kind` and a survey's width make: the same ground in
  // the same world, but other lamps, snow, fish, noise and another motion.
  std::uint32_t visit = 0;
  int frames = 120;
  double rate = 3;   // [Hz]
  double width = 0;  // of a survey's spiral [m]; 0: what the frames cover at 0.055 m each

  // What the difficulty chooses.
  Water water;
  SnowOptions snow;
  FilmOptions film;
  int fish = 0;
  double sway = 1;             // of the vehicle, times some centimetres and degrees
  bool silt_episodes = false;  // clouds that blind the fisheye for seconds
  bool turned_away = false;    // times when the wrist looks away from the ground
  Conditions conditions;
};

const std::map<std::string, SceneKind>& scene_kinds();
const std::map<std::string, Difficulty>& difficulties();

// The options of a preset, with the kind's number of frames and rate. `frames`: another number of
// them; a preset's spells lie at a share of the whole.
SceneOptions make_scene_options(SceneKind kind, Difficulty difficulty, std::uint32_t seed,
                                std::optional<int> frames = {});

// Seed of what is another one at each visit; of visit 0 it is `seed`.
std::uint32_t visit_seed(const SceneOptions& options);

// The cameras: f = 0.84 widths and a baseline of 0.15 m; a square fisheye of the stereo images'
// width that sees 172 degrees.
struct SceneCameras {
  Calibrated<RectifiedStereo> stereo;
  Calibrated<KannalaBrandt> fisheye;
};
SceneCameras make_scene_cameras(int stereo_width, int stereo_height);

inline constexpr double kFisheyeHalfAngle = 1.5009831567151233;  // [rad] 86 degrees
inline constexpr double kPinholeHalfAngle = 1.5;                 // [rad] all of the image

}  // namespace hybrid_slam
