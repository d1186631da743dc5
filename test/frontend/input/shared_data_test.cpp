#include <cstdlib>
#include <iostream>
#include <optional>

#include <catch2/catch.hpp>

#include "test/frontend/input/dataset_writer.h"

namespace hybrid_slam {
namespace {

std::optional<std::string> data_folder() {
  const char* const folder = std::getenv("HYBRID_SLAM_DATA");
  if (folder != nullptr) return folder;
  std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
  return std::nullopt;
}

// Mean absolute difference between rows of the two images where they match best along the row.
double row_mismatch(const FrameImages& images, int row_offset) {
  double sum = 0;
  int count = 0;
  const int window = 15, max_disparity = 60;
  for (int y = images.left.height / 3; y < images.left.height - 20; y += 9) {
    for (int x = max_disparity + 10; x < images.left.width - window - 10; x += 17) {
      double best = 1e9;
      for (int d = 0; d < max_disparity; ++d) {
        double difference = 0;
        for (int i = 0; i < window; ++i) {
          difference +=
              std::abs(images.left.row(y)[x + i] - images.right.row(y + row_offset)[x + i - d]);
        }
        best = std::min(best, difference / window);
      }
      sum += best;
      ++count;
    }
  }
  return sum / count;
}

TEST_CASE("the shared KITTI sequence") {
  const auto data = data_folder();
  if (!data) return;
  const auto sequence = open_sequence(*data + "/kitti", SequenceLayout::kAuto, "s1");
  CHECK(sequence->size() == 51);
  CHECK(sequence->info().truth.size() == 51);
  CHECK(sequence->info().stereo.params[4] == Approx(0.537).margin(1e-3));
  CHECK(sequence->read(50).right.width == 1226);
}

TEST_CASE("the shared UWslam sequence") {
  const auto data = data_folder();
  if (!data) return;
  const auto sequence = open_sequence(*data + "/uwsynth/hybrid", SequenceLayout::kAuto, "H1");
  CHECK(sequence->size() == 120);
  CHECK(sequence->info().truth.size() == 120);
  CHECK(sequence->info().truth_convention == "world_from_cam");
  CHECK(sequence->info().stereo.params[4] == Approx(0.1502).margin(1e-4));
  CHECK(sequence->read(119).left.height == 768);
}

TEST_CASE("the shared EuRoC sequence is row-aligned once rectified") {
  const auto data = data_folder();
  if (!data) return;
  const auto sequence = open_sequence(*data + "/euroc_backyard", SequenceLayout::kAuto, "");
  CHECK(sequence->size() == 191);
  CHECK(sequence->info().stereo.params[4] == Approx(0.12).margin(1e-3));
  const FrameImages images = sequence->read(100);
  for (const int offset : {-3, -2, 2, 3}) {
    CHECK(row_mismatch(images, 0) < row_mismatch(images, offset));
  }
}

}  // namespace
}  // namespace hybrid_slam
