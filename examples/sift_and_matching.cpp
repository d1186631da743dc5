// Features of a rectified pair, and their matches along the rows. Component: features.
#include <hybrid_slam/frontend/features/sift.h>
#include <hybrid_slam/frontend/matching/stereo_matcher.h>

#include <cmath>
#include <cstdio>
#include <vector>

using namespace hybrid_slam;

int main() {
  constexpr int kWidth = 320, kHeight = 240, kDisparity = 7;
  const auto texture = [](int x, int y) {
    const double blobs = std::sin(0.31 * x) * std::cos(0.27 * y) + std::sin(0.013 * x * y);
    return static_cast<std::uint8_t>(127 + 60 * blobs);
  };
  GrayImage left{kWidth, kHeight, std::vector<std::uint8_t>(kWidth * kHeight)};
  GrayImage right = left;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      left.row(y)[x] = texture(x, y);
      right.row(y)[x] = texture(x + kDisparity, y);
    }
  }
  const auto sift = make_sift({.max_features = 500});
  const Calibrated<RectifiedStereo> camera{{300, 300, 160, 120, 0.12}, kWidth, kHeight};
  const StereoFeatures pair = match_stereo(
      sift->extract(left, nullptr), sift->extract(right, nullptr), nullptr, nullptr, camera, {});
  double sum = 0;
  int matches = 0;
  for (std::size_t i = 0; i < pair.left.size(); ++i) {
    if (pair.right_of_left[i] < 0) continue;
    sum += pair.left.keypoints[i].x - pair.u_right[i];
    ++matches;
  }
  std::printf("%zu and %zu features, %d matches, mean disparity %.3f px, in truth %d\n",
              pair.left.size(), pair.right.size(), matches, sum / matches, kDisparity);
  return matches >= 20 && std::abs(sum / matches - kDisparity) < 0.1 ? 0 : 1;
}
