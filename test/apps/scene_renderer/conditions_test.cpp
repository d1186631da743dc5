#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "apps/scene_renderer/port_dirt.h"
#include "apps/scene_renderer/relief.h"
#include "apps/scene_renderer/shot_noise.h"
#include "test/apps/scene_renderer/scene_matches.h"

namespace hybrid_slam {
namespace {

SceneOptions short_options(int frames) {
  return make_scene_options(SceneKind::kHybrid, Difficulty::kEasy, 3, frames);
}

double mean_grey(const ColorImage& image) {
  double sum = 0;
  for (const std::uint8_t value : image.pixels) sum += value;
  return sum / static_cast<double>(image.pixels.size());
}

struct Moments {
  double mean = 0, variance = 0;
};

// Of the light of a picture of an even surface.
Moments light_of(const FilmOptions& film, float light) {
  const Camera camera = Calibrated<Pinhole>{{100, 100, 63.5, 47.5}, 128, 96};
  const ViewRays rays = make_view_rays(camera, kPinholeHalfAngle, 2);
  const std::size_t count = rays.bearing.size();
  const RadianceImage even{
      128, 96, std::vector<Color>(count, Color::Constant(light)), std::vector<float>(count, 1), {}};
  const ColorImage picture = develop(even, rays, 1, film, 5, 2);
  Moments moments;
  const auto n = static_cast<double>(picture.pixels.size());
  const auto linear = [](std::uint8_t grey) { return std::pow(grey / 255.0, 2.2); };
  for (const std::uint8_t grey : picture.pixels) moments.mean += linear(grey) / n;
  for (const std::uint8_t grey : picture.pixels) {
    moments.variance += std::pow(linear(grey) - moments.mean, 2) / n;
  }
  return moments;
}

TEST_CASE("shot noise has the variance of its number of photons") {
  FilmOptions film;
  film.noise = 0;
  film.vignetting = 0;
  const auto check = [&](float photons, float read_noise) {
    film.photons = photons;
    film.read_noise = read_noise;
    const Moments moments = light_of(film, 0.3F);
    const double expected = 0.3 / photons + std::pow(read_noise / photons, 2);
    INFO(photons << " photons, read noise of " << read_noise);
    CHECK(moments.mean == Approx(0.3).epsilon(0.01));
    CHECK(moments.variance == Approx(expected).epsilon(0.04));  // of 36864 numbers: 0.7 % 1-sigma
  };
  check(100, 0);  // 30 electrons: by inversion
  check(100, 5);
  check(1000, 0);  // 300: Gaussian
  check(1000, 20);
}

TEST_CASE("few electrons are Poisson numbers") {
  std::array<int, 4> counts{};
  constexpr int kDraws = 40000;
  for (std::uint32_t i = 0; i < kDraws; ++i) {
    const auto electrons = static_cast<std::size_t>(poisson(0.7F, i));
    if (electrons < counts.size()) ++counts[electrons];
  }
  double expected = std::exp(-0.7);
  for (std::size_t k = 0; k < counts.size(); ++k) {
    CHECK(counts[k] == Approx(kDraws * expected).margin(4 * std::sqrt(kDraws * expected)));
    expected *= 0.7 / static_cast<double>(k + 1);
  }
}

TEST_CASE("the exposure swings and jumps by as many factors of two as asked for") {
  Conditions conditions;
  CHECK(exposure_factor(conditions, 1.3, 7) == 1);
  conditions.exposure_bias = -1;
  CHECK(exposure_factor(conditions, 1.3, 7) == 0.5F);
  conditions = {};
  conditions.gain_swing = 1.5;
  float low = 1, high = 1;
  for (int i = 0; i < 400; ++i) {
    const float factor = exposure_factor(conditions, 0.01 * i, 7);
    low = std::min(low, factor);
    high = std::max(high, factor);
    CHECK(factor == Approx(exposure_factor(conditions, 4 + 0.01 * i, 7)).epsilon(1e-4));
  }
  CHECK(low == Approx(std::exp2(-1.5)).epsilon(1e-3));
  CHECK(high == Approx(std::exp2(1.5)).epsilon(1e-3));

  conditions = {};
  conditions.exposure_jumps = 2;
  std::array<int, 3> seen{};
  for (int second = 0; second < 60; ++second) {
    const float factor = exposure_factor(conditions, second, 7);
    CHECK(factor == exposure_factor(conditions, second + 0.99, 7));
    REQUIRE((factor == 0.25F || factor == 1 || factor == 4));
    ++seen[factor < 1 ? 0 : factor > 1 ? 2 : 1];
  }
  for (const int times : seen) CHECK(times > 8);  // of 20 expected: 3 sigma
}

TEST_CASE("a bias of one stop halves the light of a rendered picture") {
  SceneOptions options = make_scene_options(SceneKind::kSurvey, Difficulty::kEasy, 3, 3);
  options.film.noise = 0;
  const SceneSequence plain(options, make_scene_cameras(128, 96), 2);
  options.conditions.exposure_bias = -1;
  const SceneSequence darker(options, make_scene_cameras(128, 96), 2);
  const ColorImage a = plain.render(1).left, b = darker.render(1).left;
  double full = 0, half = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    if (a.pixels[i] == 255) continue;
    full += std::pow(a.pixels[i] / 255.0, 2.2);
    half += std::pow(b.pixels[i] / 255.0, 2.2);
  }
  CHECK(half / full == Approx(0.5).epsilon(0.01));
}

TEST_CASE("as many frames are missing or doubled as asked for") {
  Conditions conditions;
  conditions.dropped = 20;
  conditions.doubled = 30;
  const auto fates = frame_fates(conditions, 2000, 5);
  REQUIRE(fates.front().moment == 0);
  CHECK(fates.front().picture == 0);
  CHECK(fates.size() == Approx(1600).margin(72));  // 4 sigma
  int doubled = 0;
  for (std::size_t i = 1; i < fates.size(); ++i) {
    CHECK(fates[i].moment > fates[i - 1].moment);
    if (fates[i].picture == fates[i].moment) continue;
    ++doubled;
    CHECK(fates[i].picture == fates[i - 1].picture);
  }
  CHECK(doubled == Approx(0.3 * static_cast<double>(fates.size())).margin(74));
  CHECK(frame_fates({}, 50, 5).size() == 50);
}

TEST_CASE("frames are black exactly while the lamps are off") {
  SceneOptions options = short_options(9);
  options.conditions.lamps_off = {{1, 1}};
  const SceneSequence sequence(options, make_scene_cameras(96, 72), 2);
  for (int i = 0; i < 9; ++i) {
    const bool off = i >= 3 && i < 6;  // at 3 Hz
    const RenderedFrame frame = sequence.render(i);
    for (const ColorImage* image : {&frame.left, &frame.right, &*frame.fish}) {
      INFO("frame " << i);
      CHECK((mean_grey(*image) < 1) == off);  // the noise has 0.8 grey levels
      CHECK((mean_grey(*image) < 30) == off);
    }
    CHECK((sequence.ground_view(i).visible == 0) == off);
  }
}

TEST_CASE("silt hides the ground from all cameras while it lasts") {
  SceneOptions options = short_options(12);
  options.conditions.silt = {{1, 1}};
  const SceneSequence sequence(options, make_scene_cameras(96, 72), 2);
  CHECK(options.conditions.silt_at(0.5) == 0);
  CHECK(options.conditions.silt_at(0.75) == Approx(0.5));
  CHECK(options.conditions.silt_at(1) == 1);
  CHECK(options.conditions.silt_at(2.25) == Approx(0.5));
  for (int i = 0; i < 12; ++i) {
    INFO("frame " << i);
    if (i >= 3 && i <= 6) CHECK(sequence.ground_view(i).visible < 0.1);
    if (i >= 3 && i <= 6) CHECK(sequence.common_view(i).visible < 0.1);
    if (i < 2 || i > 7) CHECK(sequence.ground_view(i).visible > 0.95);
  }
}

TEST_CASE("ripples are as far apart and as high as asked for, and sand shows little") {
  ReliefOptions relief;
  relief.ripple_height = 0.02F;
  float low = 1, high = 0;
  int crests = 0;
  constexpr int kLines = 20;
  for (int line = 0; line < kLines; ++line) {
    for (float x = -4; x < 4; x += 0.004F) {
      const auto y = 0.4F * static_cast<float>(line);
      const float here = ripple_at(x, y, relief, 3);
      low = std::min(low, here);
      high = std::max(high, here);
      crests +=
          here > ripple_at(x - 0.004F, y, relief, 3) && here >= ripple_at(x + 0.004F, y, relief, 3);
    }
  }
  CHECK(low == Approx(0).margin(0.01));
  CHECK(high == Approx(1).margin(0.01));
  CHECK(8.0 * kLines / crests == Approx(relief.ripple_length).epsilon(0.1));

  const auto features = [](Difficulty preset) {
    const SceneOptions options = make_scene_options(SceneKind::kHybrid, preset, 3, 3);
    const SceneSequence sequence(options, make_scene_cameras(256, 192), 2);
    return sift_of(sequence.render(1).left, 5000).size();
  };
  CHECK(2 * features(Difficulty::kSand) < features(Difficulty::kEasy));
}

TEST_CASE("dirt covers the share of the port that is asked for, and mixes in stray light") {
  const Camera camera = make_scene_cameras(256, 192).fisheye;
  const ViewRays rays = make_view_rays(camera, kFisheyeHalfAngle, 2);
  const std::vector<float> dirt = make_dirt(rays, 0.25, 4);
  int in_view = 0, covered = 0;
  for (std::size_t i = 0; i < dirt.size(); ++i) {
    in_view += rays.sees(i);
    covered += dirt[i] >= 0.1F;
    CHECK((rays.sees(i) || dirt[i] == 0));
  }
  const double share = static_cast<double>(covered) / in_view;
  CHECK(share >= 0.25);
  CHECK(share < 0.27);  // the largest blot: pi 0.07^2 of the width's square

  RadianceImage image{rays.width, rays.height, {}, {}, {}};
  image.pixels.assign(dirt.size(), Color(0.6F, 0.3F, 0.9F));
  apply_dirt(dirt, image);
  for (std::size_t i = 0; i < dirt.size(); i += 7) {
    const float left = 1 - dirt[i] + dirt[i] / 3;
    CHECK((image.pixels[i] - left * Color(0.6F, 0.3F, 0.9F)).abs().maxCoeff() < 1e-3F);
  }
}

}  // namespace
}  // namespace hybrid_slam
