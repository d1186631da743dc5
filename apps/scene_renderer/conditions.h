#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace hybrid_slam {

enum class Ground { kRocks, kSand };  // sand: ripples, hardly any texture, no stones

// A time in which something is so.
struct Spell {
  double start = 0;   // [s]
  double length = 0;  // [s]

  bool contains(double time) const { return time >= start && time < start + length; }
};

// How the stereo cameras differ from what the calibration files say. The images are made with the
// true cameras.
struct Miscalibration {
  double pitch = 0, yaw = 0, roll = 0;  // [deg] right camera turned about its own x, y, z axis
  double focal = 0;                     // [%] true focal lengths of both cameras are longer by this
  double distortion = 0;  // [%] radial, of both: a point at the image's corner lies this much
                          // farther from the middle
  double flat_port = 0;   // [mm] from the lens to a flat port: see Lens

  bool operator==(const Miscalibration&) const = default;
};

// What makes images hard besides the water, in the user's units. As constructed: nothing does.
struct Conditions {
  double exposure_time = 0;   // [s] light is gathered from half of it before a frame's time on
  double shake = 0;           // [deg] the vehicle is shaken by up to about this, at 1.4 Hz
  double gain_swing = 0;      // [EV] the gain goes up and down by this, once in 4 s
  double exposure_jumps = 0;  // [EV] the exposure jumps up or down by this, or back, every second
  double exposure_bias = 0;   // [EV] added to what the camera would choose
  double photons = 0;         // electrons at full scale: shot noise; 0: none
  double read_noise = 0;      // [electrons] standard deviation, with `photons` only
  double dirt = 0;            // [%] of each port that dirt covers
  double arm = 0;             // [%] of the left image that the arm covers, in the mean
  double right_late = 0;      // [ms] the right image is taken after the left one
  double dropped = 0;         // [%] of the frames that are missing
  double doubled = 0;         // [%] of the frames that show the picture before once more
  Ground ground = Ground::kRocks;
  std::vector<Spell> lamps_off;  // of all lamps; then there is no daylight either
  std::vector<Spell> silt;       // clouds before all cameras
  Miscalibration miscalibration;

  bool lamps_on(double time) const;

  // 0 to 1: full in each spell; comes and goes within kSiltRise before and after.
  double silt_at(double time) const;
};

inline constexpr double kSiltRise = 0.5;  // [s]

// A number of `Whole` that the user may set: its option, its key in scene.json, its range.
template <typename Whole>
struct NamedNumber {
  const char* name;
  const char* key;
  double Whole::*value;
  double lowest, highest;
  const char* unit;
  const char* text;
};
std::span<const NamedNumber<Conditions>> condition_numbers();
std::span<const NamedNumber<Miscalibration>> miscalibration_numbers();
const std::map<std::string, Ground>& grounds();

// Factor on the exposure at a time [s], by bias, swing and jumps. The same for all cameras.
float exposure_factor(const Conditions& conditions, double time, std::uint32_t seed);

// Which of `count` moments are written, and whose picture each shows. The first one is whole.
struct FrameFate {
  int moment = 0;   // counted from 0 at the rate: its time, its truth
  int picture = 0;  // the moment whose picture is shown: another one if the frame is doubled
};
std::vector<FrameFate> frame_fates(const Conditions& conditions, int count, std::uint32_t seed);

}  // namespace hybrid_slam
