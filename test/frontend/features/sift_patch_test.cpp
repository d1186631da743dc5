// Angles and descriptors of the CPU engine against the definition, term by term, for every
// instruction set.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>
#include "frontend/features/cpu/patch_kernels.h"
#include "frontend/features/cpu/row_kernels.h"
#include "frontend/features/definition/descriptor.h"
#include "frontend/features/definition/orientation.h"
#include "test/frontend/features/on_every_target.h"
#include "test/frontend/features/test_images.h"

namespace hybrid_slam::sift {
namespace {

constexpr int kWidth = 131;
constexpr int kHeight = 97;

// The same samples as the definition reads them and as the engine stores them.
struct Level {
  std::vector<float> samples;
  std::vector<std::uint16_t> stored;
  LevelView view;
  FixedLevel fixed;

  Level(std::vector<float> greys, int width) : samples(std::move(greys)) {
    for (const float grey : samples) {
      stored.push_back(static_cast<std::uint16_t>(std::lround(grey * kLevelUnits)));
    }
    const auto height = static_cast<int>(samples.size()) / width;
    view = {samples.data(), width, width, height};
    fixed = {stored.data(), width, width, height};
  }
};

Level textured_level() {
  const GrayImage image = texture(kWidth, kHeight, 12);
  return {std::vector<float>(image.pixels.begin(), image.pixels.end()), kWidth};
}

Gradient gradient_at(const LevelView& level, const PatchFrame& frame, float column, float row) {
  return gradient(
      read_patch(level, frame, column - 1, row), read_patch(level, frame, column + 1, row),
      read_patch(level, frame, column, row - 1), read_patch(level, frame, column, row + 1));
}

std::vector<float> angles_by_definition(const LevelView& level, const PlaceInLevel& place) {
  const PatchFrame frame = orientation_frame(place.x, place.y, place.scale);
  std::array<double, kOrientationBins> sums{};
  for (int row = -kOrientationRadius; row <= kOrientationRadius; ++row) {
    for (int column = -kOrientationRadius; column <= kOrientationRadius; ++column) {
      const Gradient g =
          gradient_at(level, frame, static_cast<float>(column), static_cast<float>(row));
      const OrientationVote vote = orientation_vote(g.turn);
      const double weight = g.magnitude * orientation_window(column, row);
      sums[static_cast<std::size_t>(vote.lower)] += weight * vote.to_lower;
      sums[static_cast<std::size_t>(vote.upper)] += weight * vote.to_upper;
    }
  }
  std::array<float, kOrientationBins> votes, smoothed;
  std::copy(sums.begin(), sums.end(), votes.begin());
  for (int bin = 0; bin < kOrientationBins; ++bin) {
    smoothed[static_cast<std::size_t>(bin)] = smoothed_bin(votes.data(), bin);
  }
  const float maximum = *std::max_element(smoothed.begin(), smoothed.end());
  std::vector<float> angles;
  for (int bin = 0; bin < kOrientationBins; ++bin) {
    float angle = 0;
    if (orientation_peak(smoothed.data(), maximum, bin, &angle)) angles.push_back(angle);
  }
  if (angles.size() > kMaxOrientations) angles.resize(kMaxOrientations);
  return angles;
}

std::array<std::uint8_t, kDescriptorSize> describe_by_definition(const LevelView& level,
                                                                 const PlaceInLevel& place,
                                                                 float angle) {
  const PatchFrame frame = descriptor_frame(place.x, place.y, place.scale, angle);
  std::array<double, kDescriptorSize> sums{};
  for (int row = 0; row < kDescriptorSide; ++row) {
    for (int column = 0; column < kDescriptorSide; ++column) {
      const Gradient g = gradient_at(level, frame, descriptor_place(column), descriptor_place(row));
      for (int i = 0; i < kDescriptorSize; ++i) {
        const int bin = i % kDescriptorBins;
        const int cell = i / kDescriptorBins;
        sums[static_cast<std::size_t>(i)] +=
            static_cast<double>(g.magnitude) * cell_share(cell / kCells, row) *
            cell_share(cell % kCells, column) * bin_share(bin, g.turn);
      }
    }
  }
  std::array<float, kDescriptorSize> histogram;
  std::copy(sums.begin(), sums.end(), histogram.begin());
  std::array<std::uint8_t, kDescriptorSize> bytes;
  root_sift(histogram.data(), bytes.data());
  return bytes;
}

// Places all over the level and beyond its sides.
std::vector<PlaceInLevel> places() {
  std::mt19937 random(3);
  const auto unit = [&] { return static_cast<float>(random()) / 4294967296.F; };
  std::vector<PlaceInLevel> places;
  for (int i = 0; i < 200; ++i) {
    places.push_back({(kWidth - 1) * unit(), (kHeight - 1) * unit(), 1.8F + 1.8F * unit()});
  }
  return places;
}

TEST_CASE("SIFT's angles are those of the definition") {
  const Level level = textured_level();
  on_every_target([&] {
    int several = 0, different = 0;
    for (const PlaceInLevel& place : places()) {
      const std::vector<float> expected = angles_by_definition(level.view, place);
      std::array<float, kMaxOrientations> angles;
      const auto count = static_cast<std::size_t>(find_angles(level.fixed, place, angles.data()));
      if (count != expected.size()) {
        ++different;  // rounding decides
        continue;
      }
      several += count > 1;
      for (std::size_t i = 0; i < count; ++i) CHECK(angles[i] == Approx(expected[i]).margin(1e-3));
    }
    CHECK(different <= 1);
    CHECK(several > 20);
  });
}

TEST_CASE("SIFT's descriptors are those of the definition") {
  const Level level = textured_level();
  on_every_target([&] {
    int off_by_one = 0;
    for (const PlaceInLevel& place : places()) {
      const float angle = place.scale * 3 - 5;
      const auto expected = describe_by_definition(level.view, place, angle);
      std::array<std::uint8_t, kDescriptorSize> bytes;
      describe(level.fixed, place, angle, bytes.data());
      for (std::size_t i = 0; i < bytes.size(); ++i) {
        REQUIRE(std::abs(bytes[i] - expected[i]) <= 1);
        off_by_one += bytes[i] != expected[i];
      }
    }
    CHECK(off_by_one < 200 * kDescriptorSize / 100);
  });
}

TEST_CASE("SIFT finds no angle and describes nothing where nothing changes") {
  const Level level(std::vector<float>(40 * 40, 7.F), 40);
  on_every_target([&] {
    float angles[kMaxOrientations];
    CHECK(find_angles(level.fixed, {20, 20, 2}, angles) == 0);
    std::array<std::uint8_t, kDescriptorSize> bytes;
    bytes.fill(9);
    describe(level.fixed, {20, 20, 2}, 1, bytes.data());
    CHECK(*std::max_element(bytes.begin(), bytes.end()) == 0);
  });
}

TEST_CASE("SIFT's descriptor turns with its angle, its first row of cells is above") {
  // Left of the middle the image brightens to the right, right of it downwards.
  std::vector<float> samples;
  for (int y = 0; y < 101; ++y) {
    for (int x = 0; x < 101; ++x)
      samples.push_back(static_cast<float>(x < 50 ? 2 * x : 50 + 2 * y));
  }
  const Level level(samples, 101);
  on_every_target([&] {
    std::array<std::uint8_t, kDescriptorSize> bytes;
    const auto strongest = [&](int row, int column) {
      const auto first = bytes.begin() + (row * kCells + column) * kDescriptorBins;
      return std::max_element(first, first + kDescriptorBins) - first;
    };
    describe(level.fixed, {50, 50, 2}, 0, bytes.data());
    for (int row = 0; row < kCells; ++row) {
      CHECK(strongest(row, 0) == 0);
      CHECK(strongest(row, 3) == 2);  // a quarter turn from +x to +y
    }
    // Columns along +y: the columns of cells are now rows of the image, and what was left is in the
    // last row of cells.
    describe(level.fixed, {50, 50, 2}, static_cast<float>(std::numbers::pi / 2), bytes.data());
    for (int column = 0; column < kCells; ++column) {
      CHECK(strongest(3, column) == 6);
      CHECK(strongest(0, column) == 0);
    }
  });
}

}  // namespace
}  // namespace hybrid_slam::sift
