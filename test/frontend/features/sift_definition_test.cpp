// The arithmetic of SIFT's steps against references in double precision.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "frontend/features/definition/descriptor.h"
#include "frontend/features/definition/extremum.h"
#include "frontend/features/definition/orientation.h"
#include "frontend/features/definition/scale_space.h"

namespace hybrid_slam::sift {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;

// 27 numbers and the nine pointers that the definition takes.
struct Neighbourhood {
  std::array<float, 27> values{};
  std::array<const float*, 9> rows;

  Neighbourhood() { point(); }
  Neighbourhood(const Neighbourhood& other) : values(other.values) { point(); }
  void point() {
    for (std::size_t i = 0; i < 9; ++i) rows[i] = values.data() + 3 * i + 1;
  }
  float& at(int layer, int y, int x) {
    return values[static_cast<std::size_t>(9 * (layer + 1) + 3 * (y + 1) + x + 1)];
  }
};

TEST_CASE("Samples beyond the image are those mirrored at its first and last") {
  CHECK(mirrored(-1, 5) == 1);
  CHECK(mirrored(5, 5) == 3);
  CHECK(mirrored(-7, 5) == 1);
  CHECK(mirrored(12, 5) == 4);
  CHECK(mirrored(3, 1) == 0);
  for (int i = 0; i < 5; ++i) CHECK(mirrored(i, 5) == i);
}

TEST_CASE("An octave has the samples that lie on the image") {
  for (const int size : {11, 12, 100, 1355}) {
    CHECK((octave_size(size, -1) - 1) * 0.5 == size - 1);
    for (int octave = 0; octave < 4; ++octave) {
      const int last = (octave_size(size, octave) - 1) << octave;
      CHECK(last <= size - 1);
      CHECK(last + (1 << octave) > size - 1);
    }
  }
}

TEST_CASE("Kernels are symmetric, sum to 1 and have the variance asked for") {
  for (const double sigma : {0.55, 0.7416, 1.2263, 1.5450, 3.0901, 11.1}) {
    for (const KernelCentre centre : {KernelCentre::kSample, KernelCentre::kBetweenSamples}) {
      const int size = kernel_size(sigma, centre);
      CHECK(size % 2 == (centre == KernelCentre::kSample ? 1 : 0));
      std::vector<float> weights(static_cast<std::size_t>(size));
      make_kernel(sigma, centre, weights.data());
      double sum = 0, variance = 0;
      for (int i = 0; i < size; ++i) {
        const double weight = weights[static_cast<std::size_t>(i)];
        const double place = i - (size - 1) / 2.0;
        sum += weight;
        variance += weight * place * place;
        CHECK(weights[static_cast<std::size_t>(i)] ==
              weights[static_cast<std::size_t>(size - 1 - i)]);
      }
      CHECK(sum == Approx(1).margin(1e-6));
      CHECK(variance == Approx(sigma * sigma).epsilon(1e-5));
    }
  }
}

TEST_CASE("The blurs of the levels add up") {
  for (const int layers : {1, 3, 5}) {
    for (const bool upsample : {false, true}) {
      const double unit = upsample ? 2 : 1;
      double variance =
          std::pow(unit * kImageBlur, 2) + std::pow(unit * first_level_sigma(1.6, upsample), 2);
      CHECK(std::sqrt(variance) == Approx(1.6));
      for (int level = 1; level < layers + 3; ++level) {
        variance += std::pow(level_step_sigma(1.6, layers, level), 2);
        CHECK(std::sqrt(variance) == Approx(1.6 * std::exp2(static_cast<double>(level) / layers)));
        CHECK(std::sqrt(variance) ==
              Approx(level_sigma(1.6F, layers, static_cast<float>(level))).epsilon(1e-6));
      }
    }
  }
  CHECK(first_level_sigma(0.2, false) == kMinBlur);
  CHECK(2 * first_level_sigma(0.2, true) == kMinBlur);
}

TEST_CASE("An extremum is above or below all neighbours, the last of equal ones") {
  std::mt19937 random(1);
  Neighbourhood n;
  int extrema = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    for (float& value : n.values) value = static_cast<float>(random() % 40) - 20;
    n.at(0, 0, 0) = trial % 2 ? 19.F : -20.F;
    const float v = n.at(0, 0, 0);
    bool expected = true;
    for (std::size_t i = 0; i < 27; ++i) {
      if (i == 13) continue;
      const float other = n.values[i];
      if (v > 0 ? other > v : other < v) expected = false;
      if (other == v && i > 13) expected = false;
    }
    CHECK(is_extremum(n.rows.data()) == expected);
    extrema += expected;
  }
  CHECK(extrema > 1000);
  n.values.fill(0);
  CHECK_FALSE(is_extremum(n.rows.data()));
}

TEST_CASE("The extremum of a parabola is found exactly") {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> offset(-0.6, 0.6), curvature(0.2, 5), mix(-0.3, 0.3);
  for (int trial = 0; trial < 1000; ++trial) {
    const double sign = trial % 2 ? 1 : -1;
    const Eigen::Vector3d extremum(offset(random), offset(random), offset(random));
    Eigen::Matrix3d hessian =
        Eigen::Vector3d(curvature(random), curvature(random), curvature(random)).asDiagonal();
    for (int i = 0; i < 3; ++i) {
      for (int j = i + 1; j < 3; ++j) {
        hessian(i, j) = hessian(j, i) = mix(random) * std::sqrt(hessian(i, i) * hessian(j, j));
      }
    }
    hessian *= -sign;
    Neighbourhood n;
    for (int layer = -1; layer <= 1; ++layer) {
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          const Eigen::Vector3d d = Eigen::Vector3d(x, y, layer) - extremum;
          n.at(layer, y, x) = static_cast<float>(sign * 10 + 0.5 * d.dot(hessian * d));
        }
      }
    }
    const Fit fit = fit_extremum(n.rows.data(), 10);
    CHECK(fit.x == Approx(extremum.x()).margin(1e-5));
    CHECK(fit.y == Approx(extremum.y()).margin(1e-5));
    CHECK(fit.layer == Approx(extremum.z()).margin(1e-5));
    CHECK(fit.value == Approx(sign * 10).epsilon(1e-6));
    const PlaneFit place = fit_in_plane(n.rows.data(), fit.layer);
    CHECK(place.x == Approx(extremum.x()).margin(1e-4));
    CHECK(place.y == Approx(extremum.y()).margin(1e-4));
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(hessian.topLeftCorner<2, 2>());
    const double a = std::abs(eigen.eigenvalues()[0]), b = std::abs(eigen.eigenvalues()[1]);
    const double ratio = std::max(a, b) / std::min(a, b);
    if (std::abs(ratio - 10) > 0.01) CHECK(fit.edge == (ratio > 10));
    if (std::abs(ratio - 3) > 0.01) CHECK(fit_extremum(n.rows.data(), 3).edge == (ratio > 3));
  }
}

TEST_CASE("A saddle is an edge, a plane has no extremum") {
  Neighbourhood n;
  for (int layer = -1; layer <= 1; ++layer) {
    for (int y = -1; y <= 1; ++y) {
      for (int x = -1; x <= 1; ++x) {
        n.at(layer, y, x) = static_cast<float>(x * x - y * y - layer * layer);
      }
    }
  }
  CHECK(fit_extremum(n.rows.data(), 10).edge);
  for (int i = 0; i < 27; ++i) n.values[static_cast<std::size_t>(i)] = static_cast<float>(i);
  const auto rows_at = [&](int, int, int, const float** rows) {
    std::copy(n.rows.begin(), n.rows.end(), rows);
  };
  RefinedExtremum refined;
  CHECK_FALSE(refine_extremum(rows_at, {3, 100, 100, 0, 10}, 2, 50, 50, &refined));
}

// Differences that are one parabola, with its extremum at (layer, y, x).
struct Paraboloid {
  double layer, y, x, value;
  mutable std::array<float, 27> values{};

  void operator()(int l, int row, int column, const float** rows) const {
    for (int i = 0; i < 27; ++i) {
      const double dl = l + i / 9 - 1 - layer;
      const double dy = row + i / 3 % 3 - 1 - y;
      const double dx = column + i % 3 - 1 - x;
      values[static_cast<std::size_t>(i)] =
          static_cast<float>(value - 0.5 * (dl * dl + dy * dy + 1.5 * dx * dx));
    }
    for (std::size_t i = 0; i < 9; ++i) rows[i] = values.data() + 3 * i + 1;
  }
};

TEST_CASE("An extremum is followed to the sample that is nearest, but not far and not out") {
  const ExtremumLimits limits{3, 40, 50, 1.2F, 10};
  RefinedExtremum refined;
  CHECK(refine_extremum(Paraboloid{1.8, 20.3, 30.3, 5}, limits, 1, 19, 31, &refined));
  CHECK(refined.layer == 2);
  CHECK(refined.y == 20);
  CHECK(refined.x == 30);
  CHECK(refined.to_layer == Approx(-0.2).margin(1e-4));
  CHECK(refined.to_y == Approx(0.3).margin(1e-4));
  CHECK(refined.to_x == Approx(0.3).margin(1e-4));
  CHECK(refined.response == Approx(5));
  const auto kept = [&](double layer, double y, double x, int at_y, int at_x) {
    return refine_extremum(Paraboloid{layer, y, x, 5}, limits, 2, at_y, at_x, &refined);
  };
  CHECK(kept(2, 20, 32, 20, 30));          // two moves
  CHECK_FALSE(kept(2, 20, 33, 20, 30));    // three
  CHECK(kept(3.5, 20, 30, 20, 30));        // within reach of the last layer
  CHECK_FALSE(kept(3.7, 20, 30, 20, 30));  // beyond
  CHECK_FALSE(kept(0.3, 20, 30, 20, 30));
  CHECK(kept(2, 5, 5, 5, 5));  // at the border
  CHECK_FALSE(kept(2, 4, 5, 5, 5));
  CHECK_FALSE(kept(2, 20, 45, 20, 44));
  CHECK(kept(2, 20, 44, 20, 44));
  CHECK_FALSE(refine_extremum(Paraboloid{2, 20, 30, 1.19}, limits, 2, 20, 30, &refined));
  CHECK(refine_extremum(Paraboloid{2, 20, 30, 1.21}, limits, 2, 20, 30, &refined));
}

TEST_CASE("A level is read linearly between samples and held at its sides") {
  const int width = 7, height = 5;
  std::vector<float> samples;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) samples.push_back(static_cast<float>(2 * x - 3 * y + x * y));
  }
  const LevelView level{samples.data(), width, width, height};
  const auto value = [](double x, double y) { return kLevelUnits * (2 * x - 3 * y + x * y); };
  for (const double y : {0.0, 0.3, 2.9, 4.0}) {
    for (const double x : {0.0, 0.25, 5.5, 6.0}) {
      CHECK(read_level(level, static_cast<float>(x), static_cast<float>(y)) ==
            Approx(value(x, y)).margin(1e-5 * kLevelUnits));
    }
  }
  CHECK(read_level(level, -3, 2.5F) == Approx(value(0, 2.5)));
  CHECK(read_level(level, 9, 2.5F) == Approx(value(6, 2.5)));
  CHECK(read_level(level, 1.5F, -9) == Approx(value(1.5, 0)));
  CHECK(read_level(level, 1.5F, 99) == Approx(value(1.5, 4)));
  // Columns of the grid along the angle, rows turned from +x to +y.
  const PatchFrame frame = patch_frame(3, 2, 0.5F, static_cast<float>(kTurn / 4));
  CHECK(read_patch(level, frame, 1, 0) == Approx(value(3, 2.5)).margin(1e-5 * kLevelUnits));
  CHECK(read_patch(level, frame, 0, 1) == Approx(value(2.5, 2)).margin(1e-5 * kLevelUnits));
  samples[width + 1] += 0.6F / kLevelUnits;  // rounded
  CHECK(read_level(level, 1, 1) == value(1, 1) + 1);
}

TEST_CASE("Angles are those of atan2") {
  double largest = 0;
  for (int i = 0; i < 100000; ++i) {
    const double angle = (i + 0.5) / 100000 * kTurn;
    const double length = std::exp(i % 60 - 30);
    const auto x = static_cast<float>(length * std::cos(angle));
    const auto y = static_cast<float>(length * std::sin(angle));
    const float turn = turn_of(x, y);
    REQUIRE(turn >= 0);
    REQUIRE(turn <= 1);
    largest = std::max(largest, std::abs(std::remainder(
                                    turn - std::atan2(static_cast<double>(y), x) / kTurn, 1.0)));
  }
  INFO(largest);
  CHECK(largest < kTurnError);
  CHECK(turn_of(0, 0) == 0);
  CHECK(turn_of(1, 0) == 0);
  CHECK(turn_of(0, 2) == 0.25F);
  CHECK(turn_of(-3, 0) == 0.5F);
  CHECK(turn_of(0, -4) == 0.75F);
  const Gradient g = gradient(1, 4, 2, -2);
  CHECK(g.magnitude == Approx(5));
  CHECK(g.turn == Approx(1 - std::atan2(4.0, 3.0) / kTurn).margin(kTurnError));
}

TEST_CASE("A vote goes to the two bins next to it") {
  for (const double turn : {0.0, 0.013, 0.5, 0.98, 0.9999, 1.0}) {
    const OrientationVote vote = orientation_vote(static_cast<float>(turn));
    CHECK(vote.lower >= 0);
    CHECK(vote.lower < kOrientationBins);
    CHECK(vote.upper == (vote.lower + 1) % kOrientationBins);
    CHECK(vote.to_lower + vote.to_upper == Approx(1));
    const double bin = vote.lower + static_cast<double>(vote.to_upper);
    CHECK(std::remainder(bin / kOrientationBins - turn, 1) == Approx(0).margin(1e-6));
  }
}

TEST_CASE("The orientation's window is a Gaussian of 1.5 scales, cut at three times that") {
  for (int row = -kOrientationRadius; row <= kOrientationRadius; ++row) {
    for (int column = -kOrientationRadius; column <= kOrientationRadius; ++column) {
      const double radius = 0.75 * std::hypot(row, column);  // [scales]
      const double expected = radius > 4.5 ? 0 : std::exp(-radius * radius / (2 * 1.5 * 1.5));
      CHECK(orientation_window(column, row) == Approx(expected).margin(1e-7));
    }
  }
  CHECK(orientation_frame(1, 2, 3).step_x == Approx(0.75 * 3));
  CHECK(orientation_frame(1, 2, 3).step_y == 0);
}

TEST_CASE("Peaks of the histogram are refined, the second from 0.8 of the first") {
  for (const double peak : {0.0, 0.2, 35.7, 17.49, 35.95}) {
    std::array<float, kOrientationBins> histogram;
    for (int bin = 0; bin < kOrientationBins; ++bin) {
      const double d = std::abs(std::remainder(bin - peak, kOrientationBins));
      histogram[static_cast<std::size_t>(bin)] = static_cast<float>(std::max(0.0, 10 - d * d));
    }
    int found = 0;
    for (int bin = 0; bin < kOrientationBins; ++bin) {
      float angle = -1;
      if (!orientation_peak(histogram.data(), 10, bin, &angle)) continue;
      ++found;
      CHECK(angle >= 0);
      CHECK(angle < kTurn);
      CHECK(std::remainder(angle - peak / kOrientationBins * kTurn, kTurn) ==
            Approx(0).margin(1e-5));
    }
    CHECK(found == 1);
  }
  std::array<float, kOrientationBins> two{};
  two[3] = 10;
  two[20] = 8.01F;
  two[30] = 7.99F;
  float angle = 0;
  CHECK(orientation_peak(two.data(), 10, 3, &angle));
  CHECK(orientation_peak(two.data(), 10, 20, &angle));
  CHECK_FALSE(orientation_peak(two.data(), 10, 30, &angle));
  CHECK(smoothed_bin(two.data(), 3) == Approx(10 * 6.0 / 16));
  CHECK(smoothed_bin(two.data(), 4) == Approx(10 * 4.0 / 16));
  CHECK(smoothed_bin(two.data(), 1) == Approx(10 * 1.0 / 16));
  std::array<float, kOrientationBins> at_seam{};
  at_seam[0] = 16;
  CHECK(smoothed_bin(at_seam.data(), 35) == Approx(4));
  CHECK(smoothed_bin(at_seam.data(), 34) == Approx(1));
  const std::array<float, kOrientationBins> none{};
  CHECK_FALSE(orientation_peak(none.data(), 0, 5, &angle));
}

TEST_CASE("A sample's shares in the cells and bins are linear and sum to 1") {
  for (int sample = 0; sample < kDescriptorSide; ++sample) {
    const double place = (sample + 0.5) / kSamplesPerCell - 2.5;  // [cells] from the middle
    const double window = std::exp(-place * place / 8);
    double sum = 0;
    for (int cell = 0; cell < kCells; ++cell) {
      const double expected = std::max(0.0, 1 - std::abs(place - (cell - 1.5)));
      CHECK(cell_share(cell, sample) == Approx(expected * window).margin(1e-6));
      const bool reached =
          sample >= cell * kSamplesPerCell && sample < (cell + 2) * kSamplesPerCell;
      CHECK(reached == (expected > 0));
      sum += expected;
    }
    if (std::abs(place) < 1.5) CHECK(sum == Approx(1));
  }
  for (const double turn : {0.0, 0.1, 0.5, 0.93, 1.0}) {
    double sum = 0;
    for (int bin = 0; bin < kDescriptorBins; ++bin) {
      const double share = bin_share(bin, static_cast<float>(turn));
      const double distance = std::abs(std::remainder(turn * 8 - bin, 8.0));
      CHECK(share == Approx(std::max(0.0, 1 - distance)).margin(1e-6));
      sum += share;
    }
    CHECK(sum == Approx(1));
  }
}

TEST_CASE("RootSIFT in bytes") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int trial = 0; trial < 50; ++trial) {
    std::array<float, kDescriptorSize> histogram;
    std::array<double, kDescriptorSize> reference;
    double squares = 0, sum = 0;
    for (std::size_t i = 0; i < histogram.size(); ++i) {
      histogram[i] = static_cast<float>(std::pow(unit(random), trial % 8 + 1));
      reference[i] = histogram[i];
      squares += reference[i] * reference[i];
    }
    for (double& value : reference) value = std::min(value, 0.2 * std::sqrt(squares));
    for (const double value : reference) sum += value;
    std::array<std::uint8_t, kDescriptorSize> bytes;
    root_sift(histogram.data(), bytes.data());
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      const double expected = std::min(255.0, 512 * std::sqrt(reference[i] / sum));
      CHECK(std::abs(bytes[i] - expected) < 0.501);
    }
  }
  std::array<float, kDescriptorSize> histogram{};
  std::array<std::uint8_t, kDescriptorSize> bytes;
  bytes.fill(7);
  root_sift(histogram.data(), bytes.data());
  CHECK(*std::max_element(bytes.begin(), bytes.end()) == 0);
  // One number alone is cut, with the others at nothing, and stays what it is: all of the sum.
  histogram.fill(0);
  histogram[9] = 3;
  root_sift(histogram.data(), bytes.data());
  CHECK(bytes[9] == 255);
}

}  // namespace
}  // namespace hybrid_slam::sift
