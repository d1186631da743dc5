#include "frontend/matching/patch_alignment.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Geometry>
#include <catch2/catch.hpp>

#include "test/frontend/matching/blob_texture.h"

namespace hybrid_slam {
namespace {

constexpr int kWidth = 240;
constexpr int kHeight = 200;

struct Errors {
  int tried = 0;
  int converged = 0;
  double mean = 0;  // of the absolute errors of x and y [px]
  Eigen::Vector2d bias{0, 0};
  double correlation = 0;
};

// Aligns patches of one texture in two images under a known map, from a start that is off by up to
// `start_error` in x and y.
Errors align_all(const Eigen::Matrix2d& target_from_reference, double gain, double bias,
                 double noise, const AlignmentOptions& options, double start_error = 0.8,
                 double scale = 2, bool map_is_known = true) {
  std::mt19937_64 random(11);
  const BlobTexture texture(kWidth, kHeight, random);
  const Eigen::Vector2d centre(kWidth / 2.0, kHeight / 2.0);
  const Eigen::Vector2d shift(0.37, -0.21);
  // target = target_from_reference * (reference - centre) + centre + shift.
  const Eigen::Matrix2d reference_from_target = target_from_reference.inverse();
  const Eigen::Vector2d offset = centre - reference_from_target * (centre + shift);
  const ImagePyramid reference(texture.render(kWidth, kHeight, Eigen::Matrix2d::Identity(),
                                              Eigen::Vector2d::Zero(), 1, 0, noise, random));
  const ImagePyramid target(
      texture.render(kWidth, kHeight, reference_from_target, offset, gain, bias, noise, random));
  Errors errors;
  const auto symmetric = [&] { return 2 * random_unit(random) - 1; };
  for (int k = 0; k < 300; ++k) {
    const Eigen::Vector2d place = centre + Eigen::Vector2d(35 * symmetric(), 30 * symmetric());
    const auto patch = make_reference_patch(reference, place.x(), place.y(), scale, options);
    REQUIRE(patch);
    const Eigen::Vector2d truth = target_from_reference * (place - centre) + centre + shift;
    Eigen::Vector2d start = truth + start_error * Eigen::Vector2d(symmetric(), symmetric());
    if (options.horizontal_only) start.y() = truth.y();
    const Eigen::Matrix2d known =
        map_is_known ? target_from_reference : Eigen::Matrix2d::Identity();
    const Alignment found = align_patch(*patch, target, known, start, options);
    ++errors.tried;
    if (!found.converged) continue;
    ++errors.converged;
    errors.mean += (found.position - truth).lpNorm<1>() / (options.horizontal_only ? 1 : 2);
    errors.bias += found.position - truth;
    errors.correlation += found.correlation;
  }
  const double count = errors.converged;
  errors.mean /= count;
  errors.bias /= count;
  errors.correlation /= count;
  return errors;
}

Eigen::Matrix2d affine(double scale, double degrees, double shear) {
  Eigen::Matrix2d sheared;
  sheared << 1, shear, 0, 1;
  return scale * Eigen::Rotation2Dd(degrees * M_PI / 180).toRotationMatrix() * sheared;
}

TEST_CASE("Alignment finds sub-pixel shifts") {
  const Errors clean = align_all(Eigen::Matrix2d::Identity(), 1, 0, 0, {});
  CHECK(clean.converged >= 0.99 * clean.tried);
  CHECK(clean.mean < 0.01);
  CHECK(clean.bias.norm() < 0.002);
  CHECK(clean.correlation > 0.99);
  const Errors noisy = align_all(Eigen::Matrix2d::Identity(), 1, 0, 5, {});
  CHECK(noisy.converged >= 0.95 * noisy.tried);
  CHECK(noisy.mean < 0.1);
}

TEST_CASE("Alignment does not mind gain and bias") {
  const Errors errors = align_all(Eigen::Matrix2d::Identity(), 0.6, 50, 0, {});
  CHECK(errors.converged >= 0.99 * errors.tried);
  CHECK(errors.mean < 0.015);
}

TEST_CASE("Alignment follows affine maps") {
  // Where the scales differ, so does the blur, which costs a little. A scale of 2 is another level.
  struct Case {
    double scale, clean_error, noisy_error;
  };
  for (const Case c : {Case{0.8, 0.02, 0.1}, Case{1.0, 0.02, 0.1}, Case{1.25, 0.02, 0.1},
                       Case{0.7, 0.03, 0.1}, Case{1.4, 0.03, 0.1}, Case{2.0, 0.03, 0.15}}) {
    const Errors clean = align_all(affine(c.scale, 25, 0.15), 1.1, -10, 0, {});
    const Errors noisy = align_all(affine(c.scale, 25, 0.15), 1.1, -10, 5, {});
    INFO("scale " << c.scale << ": " << clean.converged << " converged");
    CHECK(clean.converged >= 0.95 * clean.tried);
    CHECK(clean.mean < c.clean_error);
    CHECK(noisy.converged >= 0.9 * noisy.tried);
    CHECK(noisy.mean < c.noisy_error);
  }
}

TEST_CASE("Alignment on coarser levels counts in the image's pixels") {
  AlignmentOptions options;
  options.half_size = 5;
  for (const double scale : {6.4, 12.8}) {
    const Errors errors = align_all(Eigen::Matrix2d::Identity(), 1, 0, 0, options, 1.5, scale);
    INFO("mean " << errors.mean << ", " << errors.converged << " converged");
    CHECK(errors.converged >= 0.95 * errors.tried);
    CHECK(errors.mean < 0.01 * scale);
    CHECK(errors.bias.norm() < 0.003 * scale);
  }
}

TEST_CASE("Alignment along the row leaves the row alone") {
  AlignmentOptions options;
  options.horizontal_only = true;
  const Errors errors = align_all(Eigen::Matrix2d::Identity(), 1, 0, 0, options);
  CHECK(errors.converged >= 0.99 * errors.tried);
  CHECK(errors.mean < 0.01);
  CHECK(errors.bias.y() == 0);
}

// Ground that slants by about 40 degrees, seen from ten baselines. Without slopes of the disparity
// the mean error is 0.09 to 0.16 px.
TEST_CASE("Alignment along the row does not mind a disparity that changes across the patch") {
  AlignmentOptions options;
  options.half_size = 5;
  options.horizontal_only = true;
  for (const Eigen::Vector2d& slope :
       {Eigen::Vector2d(0.08, 0), Eigen::Vector2d(-0.08, 0), Eigen::Vector2d(0, 0.1)}) {
    Eigen::Matrix2d slanted = Eigen::Matrix2d::Identity();
    slanted.row(0) += slope.transpose();
    const Errors errors = align_all(slanted, 1, 0, 0, options, 0.8, 2, false);
    INFO("slope " << slope.transpose() << ", mean " << errors.mean);
    CHECK(errors.converged >= 0.98 * errors.tried);
    CHECK(errors.mean < 0.025);
  }
}

TEST_CASE("Alignment says where it failed") {
  std::mt19937_64 random(12);
  const auto image = [&](double noise, double gain) {
    const BlobTexture texture(kWidth, kHeight, random);
    return ImagePyramid(texture.render(kWidth, kHeight, Eigen::Matrix2d::Identity(),
                                       Eigen::Vector2d::Zero(), gain, 0, noise, random));
  };
  const ImagePyramid reference = image(0, 1);
  const Eigen::Matrix2d same = Eigen::Matrix2d::Identity();
  const auto patch = make_reference_patch(reference, 100, 100, 2, {});
  REQUIRE(patch);

  SECTION("near the border") {
    CHECK_FALSE(make_reference_patch(reference, 8, 100, 2, {}));
    CHECK_FALSE(make_reference_patch(reference, 100, kHeight - 9, 2, {}));
    CHECK_FALSE(align_patch(*patch, reference, same, {7, 100}, {}).converged);
    CHECK_FALSE(align_patch(*patch, reference, same, {-1e9, 1e9}, {}).converged);
    CHECK_FALSE(align_patch(*patch, reference, same, {std::nan(""), 100}, {}).converged);
    CHECK_FALSE(make_reference_patch(reference, std::nan(""), 100, 2, {}));
  }
  SECTION("without texture") {
    const GrayImage grey{kWidth, kHeight, std::vector<std::uint8_t>(kWidth * kHeight, 77)};
    const ImagePyramid flat(grey);
    CHECK_FALSE(make_reference_patch(flat, 100, 100, 2, {}));
    CHECK_FALSE(align_patch(*patch, flat, same, {100, 100}, {}).converged);
  }
  SECTION("elsewhere") {
    const ImagePyramid other = image(0, 1);
    int converged = 0;
    for (int x = 40; x < 200; x += 4) {
      converged += align_patch(*patch, other, same, {static_cast<double>(x), 100.0}, {}).converged;
    }
    CHECK(converged == 0);
  }
  SECTION("with a map that is none") {
    CHECK_FALSE(align_patch(*patch, reference, Eigen::Matrix2d::Zero(), {100, 100}, {}).converged);
    CHECK_FALSE(align_patch(*patch, reference, NAN * same, {100, 100}, {}).converged);
  }
  SECTION("and where it did not") {
    const Alignment found = align_patch(*patch, reference, same, {100.5, 99.6}, {});
    CHECK(found.converged);
    CHECK((found.position - Eigen::Vector2d(100, 100)).norm() < 0.005);
    CHECK(found.correlation > 0.9999);
    CHECK(found.residual < 0.2);
  }
}

TEST_CASE("A pyramid's levels show the same places") {
  // A wide blob stays where it is, and a level has half the size of the one before.
  GrayImage image{161, 121, {}};
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double r2 = (x - 83.0) * (x - 83.0) + (y - 61.0) * (y - 61.0);
      image.pixels.push_back(
          static_cast<std::uint8_t>(std::lround(20 + 200 * std::exp(-r2 / 300))));
    }
  }
  const ImagePyramid pyramid(image, 5);
  REQUIRE(pyramid.levels() == 4);  // of 121, 61, 31 and 16 rows
  CHECK(pyramid.level(3).width == 21);
  CHECK(pyramid.level(3).height == 16);
  for (int k = 0; k < pyramid.levels(); ++k) {
    const ImagePyramid::Level& level = pyramid.level(k);
    double sum = 0, sum_x = 0, sum_y = 0;
    for (int y = 0; y < level.height; ++y) {
      for (int x = 0; x < level.width; ++x) {
        const double weight = level.row(y)[x] / ImagePyramid::kUnits - 20;
        sum += weight;
        sum_x += weight * x;
        sum_y += weight * y;
      }
    }
    CHECK(std::ldexp(sum_x / sum, k) == Approx(83).margin(0.05));
    CHECK(std::ldexp(sum_y / sum, k) == Approx(61).margin(0.05));
  }
  CHECK_THROWS_AS(ImagePyramid(GrayImage{}), std::logic_error);
}

TEST_CASE("Alignment options are checked") {
  AlignmentOptions options;
  CHECK(options.validate().empty());
  options.half_size = 0;
  CHECK_FALSE(options.validate().empty());
  options = {};
  options.max_shift = std::nan("");
  CHECK_FALSE(options.validate().empty());
}

}  // namespace
}  // namespace hybrid_slam
