#pragma once

#include <cstdint>

#include <Eigen/Core>

// Noise that is a function of place (or of a counter) and seed alone: the same for any order of
// evaluation and any number of threads.
namespace hybrid_slam {

// 32 well mixed bits of three integers.
inline std::uint32_t mixed_bits(std::int32_t x, std::int32_t y, std::int32_t z,
                                std::uint32_t seed) {
  std::uint32_t h = static_cast<std::uint32_t>(x) * 0x8da6b343U ^
                    static_cast<std::uint32_t>(y) * 0xd8163841U ^
                    static_cast<std::uint32_t>(z) * 0xcb1ab31fU ^ seed * 0x165667b1U;
  h = (h ^ (h >> 15)) * 0x2c1b3c6dU;
  h = (h ^ (h >> 12)) * 0x297a2d39U;
  return h ^ (h >> 15);
}

// 24 bits as a number in [0, 1).
inline float unit_interval(std::uint32_t bits) { return static_cast<float>(bits >> 8) * 0x1p-24F; }

// Random numbers by counting: the n-th number of a stream.
class Counter {
 public:
  Counter(std::uint32_t seed, int stream) : seed_(seed), stream_(stream) {}
  float uniform() { return unit_interval(mixed_bits(next_++, stream_, 77, seed_)); }
  float uniform(float low, float high) { return low + (high - low) * uniform(); }

 private:
  std::uint32_t seed_;
  std::int32_t stream_;
  std::int32_t next_ = 0;
};

// 0 below `low`, 1 above `high`, smooth between.
inline float smooth_step(float low, float high, float x) {
  const float t = std::min(std::max((x - low) / (high - low), 0.0F), 1.0F);
  return t * t * (3 - 2 * t);
}

struct NoiseSample {
  float value = 0;
  Eigen::Vector3f gradient = Eigen::Vector3f::Zero();
};

// Gradient noise (Perlin 2002) on the unit lattice, about -0.8 to 0.8, with its gradient.
NoiseSample gradient_noise(const Eigen::Vector3f& p, std::uint32_t seed);

// Sum of octaves of gradient noise from wavelength `longest` down to what a sampling distance of
// `footprint` can hold: an octave fades between four and two footprints. Octave i has the amplitude
// gain^i in `value`. In `gradient` all octaves have the same slope, times gain^i: the derivative of
// a height whose amplitude is the wavelength, per length.
struct Octaves {
  float longest = 1;   // [m]
  float shortest = 0;  // [m]; none below, even if the footprint would allow it
  float gain = 0.8F;
};
NoiseSample octave_noise(const Eigen::Vector3f& p, const Octaves& octaves, float footprint,
                         std::uint32_t seed);

// One ball in each cell of a unit lattice, of random place and radius. None leaves its cell, not
// even if it is a quarter larger and has a rim around it.
inline constexpr float kBallRim = 0.07F;
struct Ball {
  Eigen::Vector3f offset;  // from the ball's centre to the point asked for
  float radius = 0;
  std::uint32_t bits = 0;  // random, to choose its kind
};

// The ball of the cell that `p` lies in.
Ball ball_near(const Eigen::Vector3f& p, std::uint32_t seed);

}  // namespace hybrid_slam
