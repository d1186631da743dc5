#include "frontend/calibration/noise_floor.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "frontend/calibration/rig_calibrator.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kHalves = 2;

// Residuals with the noise of landmarks that are seen in one half alone: all of a cell and a half
// are off by the same draw, besides their own noise. `systematic`: by cell, of u [px].
template <typename Systematic>
ResidualMap residuals_of(const Systematic& systematic, int seed) {
  std::mt19937 random(static_cast<unsigned>(seed));
  std::normal_distribution<double> noise(0, 0.3), common(0, 0.05);
  ResidualMap map;
  map.cells = ImageCells(512, 384);
  map.halves.resize(map.cells.size());
  for (std::size_t cell = 0; cell < map.cells.size(); ++cell) {
    for (std::size_t half = 0; half < kHalves; ++half) {
      for (std::size_t measured = 0; measured < kMeasured; ++measured) {
        const double off = common(random) + (measured == 0 ? systematic(cell) : 0);
        for (int i = 0; i < 100; ++i) map.halves[cell][measured][half].add(off + noise(random));
      }
    }
  }
  return map;
}

TEST_CASE("a floor is what both halves of a run agree in", "[noise_floor]") {
  // The right half of the image is off by 0.4 px, to and fro.
  const auto off = [](std::size_t cell) {
    return cell % 8 < 4 ? 0.0 : (cell % 2 == 0 ? 0.4 : -0.4);
  };
  const ResidualMap map = residuals_of(off, 1);
  const SystematicPart part = systematic_part(map);
  // Of u alone, in half of the cells, per coordinate of u and v.
  CHECK(part.image_rms == Approx(0.4 / 2).epsilon(0.1));
  CHECK(part.disparity_rms < 0.03);
  const auto floor = floor_of(map);
  REQUIRE(floor);
  CHECK(std::sqrt(floor->variance(500, 100)) == Approx(0.4 / std::sqrt(2)).epsilon(0.1));
  CHECK(std::sqrt(floor->variance(10, 100)) < 0.05);
  CHECK(floor->over(0.1F, 500, 100) == Approx(std::hypot(0.1, 0.4 / std::sqrt(2))).epsilon(0.1));
}

TEST_CASE("there is no floor where nothing is systematic", "[noise_floor]") {
  for (int seed = 0; seed < 50; ++seed) {
    CHECK(floor_of(residuals_of([](std::size_t) { return 0.0; }, seed)) == nullptr);
  }
}

TEST_CASE("an image is divided into cells that cover it", "[noise_floor]") {
  const ImageCells cells(512, 384);
  CHECK(cells.rows == 6);
  CHECK(cells.of(0, 0) == 0);
  CHECK(cells.of(511, 383) == cells.size() - 1);
  CHECK(cells.of(-9, 1000) == 40);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    CHECK(cells.of(cells.center_x(i), cells.center_y(i)) == i);
  }
}

}  // namespace
}  // namespace hybrid_slam
