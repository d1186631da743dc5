#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <random>

namespace hybrid_slam {

// Samples for RANSAC that depend on the seed alone: the same on every machine and standard library.
class RandomSampler {
 public:
  explicit RandomSampler(std::uint64_t seed) : engine_(seed) {}

  // Uniform in [0, n), n > 0.
  int below(int n) {
    const auto range = static_cast<std::uint64_t>(n);
    const std::uint64_t limit = std::mt19937_64::max() - std::mt19937_64::max() % range;
    std::uint64_t value = engine_();
    while (value >= limit) value = engine_();
    return static_cast<int>(value % range);
  }

  // Three different indices in [0, n), n >= 3.
  std::array<int, 3> three_of(int n) {
    std::array<int, 3> sample{};
    sample[0] = below(n);
    do {
      sample[1] = below(n);
    } while (sample[1] == sample[0]);
    do {
      sample[2] = below(n);
    } while (sample[2] == sample[0] || sample[2] == sample[1]);
    return sample;
  }

 private:
  std::mt19937_64 engine_;
};

// Samples of three after which one of inliers alone has been drawn with this confidence, `most` of
// them at most.
inline int needed_samples(double inlier_share, double confidence, int most) {
  const double good_sample = inlier_share * inlier_share * inlier_share;
  if (good_sample >= 1) return 1;
  const double needed = std::log(1 - confidence) / std::log1p(-good_sample);
  return needed < most ? static_cast<int>(std::ceil(needed)) : most;
}

}  // namespace hybrid_slam
