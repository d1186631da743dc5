// SIFT against OpenCV's on real images, at equal settings.
#include <cstdlib>
#include <iostream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include "apps/feature_eval/opencv_sift.h"
#include "frontend/features/sift.h"
#include "test/frontend/features/sift_quality.h"

namespace hybrid_slam {
namespace {

constexpr double kLeast = 0.98;  // of what OpenCV's reaches

PairQuality sum_of(const std::vector<QualityRow>& rows) {
  PairQuality sum;
  for (const QualityRow& row : rows) sum += row.sum;
  return sum;
}

TEST_CASE("SIFT repeats and matches no worse than OpenCV's", "[slow]") {
  const char* data = std::getenv("HYBRID_SLAM_DATA");
  if (data == nullptr) {
    std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
    return;
  }
  SiftOptions options;
  options.upsample = GENERATE(true, false);
  const auto ours = make_sift(options);
  const auto reference = make_opencv_sift(options);

  const std::string images = std::string(data) + "/underwater_images";
  const PairQuality warped = sum_of(warped_copies(*ours, images, 8));
  const PairQuality warped_reference = sum_of(warped_copies(*reference, images, 8));
  INFO("repeated " << warped.repeated / warped.visible << " against "
                   << warped_reference.repeated / warped_reference.visible << ", correct matches "
                   << warped.correct << " against " << warped_reference.correct);
  REQUIRE(warped_reference.correct > 5000);
  CHECK(warped.repeated / warped.visible >
        kLeast * warped_reference.repeated / warped_reference.visible);
  CHECK(warped.correct > kLeast * warped_reference.correct);
  CHECK(warped.correct / warped.matches >
        kLeast * warped_reference.correct / warped_reference.matches);

  const std::string sequence = std::string(data) + "/uwsynth/hybrid/H1";
  const PairQuality stereo = stereo_pairs(*ours, sequence, 40).sum;
  const PairQuality stereo_reference = stereo_pairs(*reference, sequence, 40).sum;
  INFO("stereo: correct " << stereo.correct << " against " << stereo_reference.correct);
  REQUIRE(stereo_reference.correct > 1000);
  CHECK(stereo.correct > kLeast * stereo_reference.correct);
}

}  // namespace
}  // namespace hybrid_slam
