#include "apps/slam/upsampling.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>
#include <vector>

namespace hybrid_slam {
namespace {

constexpr int kWidth = 400;
constexpr int kHeight = 300;
constexpr int kDisparity = 8;  // of everything [px]
constexpr int kWallWidth = kWidth + kDisparity;

// A wall of blurred noise (sigma 1.4 px), seen by a stereo pair with this focal length [px].
class Wall {
 public:
  explicit Wall(double focal) {
    cameras.stereo = {{focal, focal, 199.5, 149.5, 0.1}, kWidth, kHeight};
    std::mt19937 random(7);
    wall_.resize(static_cast<std::size_t>(kHeight) * kWallWidth);
    for (float& grey : wall_) grey = static_cast<float>(random() % 256);
    for (int i = 0; i < 3; ++i) blur();
  }

  CameraRig cameras;

  std::vector<std::shared_ptr<const StereoImages>> pairs() const {
    return {3, std::make_shared<const StereoImages>(StereoImages{0, cut(0), cut(kDisparity)})};
  }

 private:
  GrayImage cut(int left) const {
    GrayImage image{kWidth, kHeight, {}};
    for (int y = 0; y < kHeight; ++y) {
      for (int x = left; x < left + kWidth; ++x) {
        const float grey = 128 + 4 * (wall_[static_cast<std::size_t>(y * kWallWidth + x)] - 128);
        image.pixels.push_back(static_cast<std::uint8_t>(std::clamp(grey, 0.0F, 255.0F)));
      }
    }
    return image;
  }

  // Means of three by three pixels.
  void blur() {
    const std::vector<float> sharp = wall_;
    for (int y = 1; y < kHeight - 1; ++y) {
      for (int x = 1; x < kWallWidth - 1; ++x) {
        float sum = 0;
        for (int dy = -1; dy <= 1; ++dy) {
          for (int dx = -1; dx <= 1; ++dx) {
            sum += sharp[static_cast<std::size_t>((y + dy) * kWallWidth + x + dx)];
          }
        }
        wall_[static_cast<std::size_t>(y * kWallWidth + x)] = sum / 9;
      }
    }
  }

  std::vector<float> wall_;
};

UpsamplingEvidence choose_upsampling(const Wall& wall, SlamOptions& options) {
  return hybrid_slam::choose_upsampling(wall.cameras, wall.pairs(), options);
}

SlamOptions wanting(int features) {
  SlamOptions options;
  options.features = features;
  options.distribute();
  return options;
}

TEST_CASE("Where features are small and enough without it, there is no upsampling") {
  SlamOptions options = wanting(200);
  const UpsamplingEvidence evidence = choose_upsampling(Wall(3000), options);
  CHECK(evidence.chosen_by == "first pairs");
  CHECK(evidence.features == 200);
  CHECK(evidence.feature_size > 1.6 / 3000);  // the finest features of an image alone
  CHECK(evidence.feature_size < 2e-3);
  CHECK(options.upsampling == Upsampling::kOff);
  CHECK_FALSE(options.sift.upsample);
}

TEST_CASE("Where features are large as angles, or too few, there is upsampling") {
  SlamOptions wide = wanting(200);
  const UpsamplingEvidence large = choose_upsampling(Wall(300), wide);
  CHECK(large.feature_size > 1.6 / 300);
  CHECK(wide.upsampling == Upsampling::kOn);
  SlamOptions many = wanting(100000);
  const UpsamplingEvidence few = choose_upsampling(Wall(3000), many);
  CHECK(few.feature_size < 2e-3);
  CHECK(few.features < 10000);
  CHECK(many.upsampling == Upsampling::kOn);
  CHECK(many.sift.upsample);
}

TEST_CASE("What the options, a fisheye or damaged images leave no choice of") {
  SlamOptions off = wanting(200);
  off.upsampling = Upsampling::kOff;
  CHECK(choose_upsampling(Wall(300), off).chosen_by == "option");
  CHECK_FALSE(off.sift.upsample);

  Wall hybrid(3000);
  hybrid.cameras.fisheye.emplace();
  SlamOptions with_fisheye = wanting(200);
  CHECK(choose_upsampling(hybrid, with_fisheye).chosen_by == "fisheye");
  CHECK(with_fisheye.sift.upsample);

  SlamOptions damaged = wanting(200);
  CHECK(hybrid_slam::choose_upsampling(Wall(3000).cameras, {}, damaged).chosen_by ==
        "unreadable pairs");
  CHECK(damaged.sift.upsample);
}

}  // namespace
}  // namespace hybrid_slam
