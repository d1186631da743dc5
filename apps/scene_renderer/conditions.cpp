#include "apps/scene_renderer/conditions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "apps/scene_renderer/noise.h"

namespace hybrid_slam {
namespace {

constexpr double kSwingPeriod = 4;   // [s]
constexpr double kJumpInterval = 1;  // [s]

}  // namespace

bool Conditions::lamps_on(double time) const {
  return std::none_of(lamps_off.begin(), lamps_off.end(),
                      [&](const Spell& spell) { return spell.contains(time); });
}

double Conditions::silt_at(double time) const {
  double strength = 0;
  for (const auto& [start, length] : silt) {
    const double outside = std::max({start - time, time - start - length, 0.0});
    strength =
        std::max<double>(strength, 1 - smooth_step(0, kSiltRise, static_cast<float>(outside)));
  }
  return strength;
}

std::span<const NamedNumber<Conditions>> condition_numbers() {
  using C = Conditions;
  static constexpr std::array<NamedNumber<Conditions>, 12> kNumbers{{
      {"exposure-time", "exposure_time_s", &C::exposure_time, 0, 10, "S",
       "in which a frame gathers light, half of it before the frame's time: motion blur [s]"},
      {"shake", "shake_deg", &C::shake, 0, 10, "DEG",
       "of the vehicle, at 1.4 Hz, up to this [deg]"},
      {"gain-swing", "gain_swing_ev", &C::gain_swing, 0, 6, "EV",
       "by which the gain goes up and down every 4 s [EV, factors of 2]"},
      {"exposure-jumps", "exposure_jumps_ev", &C::exposure_jumps, 0, 6, "EV",
       "by which the exposure jumps up, down or back every second [EV]"},
      {"exposure-bias", "exposure_bias_ev", &C::exposure_bias, -10, 10, "EV",
       "added to what the camera would choose [EV]"},
      {"photons", "photons_at_full_scale", &C::photons, 0, 1e6, "N",
       "electrons of a white pixel: shot noise; 0: none"},
      {"read-noise", "read_noise_electrons", &C::read_noise, 0, 1000, "N",
       "standard deviation, needs --photons [electrons]"},
      {"dirt", "dirt_percent", &C::dirt, 0, 90, "PERCENT", "of each camera's port under dirt [%]"},
      {"arm", "arm_percent", &C::arm, 0, 60, "PERCENT",
       "of the left image behind the vehicle's arm, in the mean [%]; writes masks/"},
      {"right-late", "right_late_ms", &C::right_late, -1000, 1000, "MS",
       "by which the right image is taken after the left one [ms]"},
      {"drop", "dropped_percent", &C::dropped, 0, 90, "PERCENT", "of the frames are missing [%]"},
      {"double", "doubled_percent", &C::doubled, 0, 90, "PERCENT",
       "of the frames show the frame before once more [%]"},
  }};
  return kNumbers;
}

std::span<const NamedNumber<Miscalibration>> miscalibration_numbers() {
  using M = Miscalibration;
  static constexpr std::array<NamedNumber<Miscalibration>, 6> kNumbers{{
      {"pitch", "right_pitch_deg", &M::pitch, -2, 2, "DEG", ""},
      {"yaw", "right_yaw_deg", &M::yaw, -2, 2, "DEG", ""},
      {"roll", "right_roll_deg", &M::roll, -2, 2, "DEG", ""},
      {"focal", "focal_percent", &M::focal, -5, 5, "PERCENT", ""},
      {"distortion", "distortion_percent", &M::distortion, -5, 5, "PERCENT", ""},
      {"flat-port", "flat_port_mm", &M::flat_port, 0, 100, "MM", ""},
  }};
  return kNumbers;
}

const std::map<std::string, Ground>& grounds() {
  static const std::map<std::string, Ground> names{{"rocks", Ground::kRocks},
                                                   {"sand", Ground::kSand}};
  return names;
}

float exposure_factor(const Conditions& conditions, double time, std::uint32_t seed) {
  const double phase = unit_interval(mixed_bits(1, 0, 41, seed));
  const double swing = std::sin(2 * std::numbers::pi * (time / kSwingPeriod + phase));
  const auto stretch = static_cast<std::int32_t>(std::floor(time / kJumpInterval));
  const int jump = static_cast<int>(3 * unit_interval(mixed_bits(stretch, 1, 41, seed))) - 1;
  return static_cast<float>(std::exp2(conditions.exposure_bias + conditions.gain_swing * swing +
                                      conditions.exposure_jumps * jump));
}

std::vector<FrameFate> frame_fates(const Conditions& conditions, int count, std::uint32_t seed) {
  std::vector<FrameFate> fates;
  for (int moment = 0; moment < count; ++moment) {
    const auto happens = [&](double percent, int what) {
      return moment > 0 && 100 * unit_interval(mixed_bits(moment, what, 43, seed)) < percent;
    };
    if (happens(conditions.dropped, 0)) continue;
    fates.push_back({moment, happens(conditions.doubled, 1) ? fates.back().picture : moment});
  }
  return fates;
}

}  // namespace hybrid_slam
