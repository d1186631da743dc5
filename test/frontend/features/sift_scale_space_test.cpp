// The CPU engine's rows and scale space against straightforward computations, for every instruction
// set.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <catch2/catch.hpp>
#include "frontend/features/cpu/row_kernels.h"
#include "frontend/features/cpu/scale_space.h"
#include "frontend/features/definition/extremum.h"
#include "frontend/features/definition/scale_space.h"
#include "test/frontend/features/on_every_target.h"
#include "test/frontend/features/test_images.h"

namespace hybrid_slam::sift {
namespace {

std::vector<float> random_row(std::mt19937& random, std::size_t size, unsigned levels) {
  std::vector<float> row(size + 2 * kRowPadding);
  for (float& v : row) v = static_cast<float>(random() % levels) - static_cast<float>(levels / 2);
  return row;
}

std::vector<float> symmetric_weights(std::mt19937& random, std::size_t count) {
  std::vector<float> weights(count);
  for (std::size_t i = 0; i < count; ++i) {
    weights[i] = weights[count - 1 - i] = static_cast<float>(random() % 100) / 100;
  }
  return weights;
}

TEST_CASE("SIFT's rows are summed up with symmetric weights") {
  on_every_target([] {
    std::mt19937 random(1);
    for (const std::size_t width : {1U, 7U, 16U, 31U, 64U, 67U, 133U}) {
      for (const std::size_t count : {1U, 2U, 5U, 6U, 21U}) {
        std::vector<std::vector<float>> rows;
        std::vector<const float*> pointers;
        for (std::size_t i = 0; i < count; ++i) rows.push_back(random_row(random, width, 255));
        for (const auto& row : rows) pointers.push_back(row.data());
        const std::vector<float> weights = symmetric_weights(random, count);
        std::vector<float> out(width + kRowPadding);
        symmetric_sum(pointers.data(), count, weights.data(), width, out.data());
        for (std::size_t x = 0; x < width; ++x) {
          double sum = 0;
          for (std::size_t i = 0; i < count; ++i) sum += weights[i] * rows[i][x];
          REQUIRE(out[x] == Approx(sum).margin(1e-3));
        }
      }
    }
  });
}

// The kernels of the default scales, and others.
constexpr std::size_t kCounts[] = {1, 3, 5, 9, 11, 13, 15, 17, 21, 23};

TEST_CASE("SIFT's rows are blurred along themselves and subtracted") {
  on_every_target([] {
    std::mt19937 random(5);
    for (const std::size_t width : {1U, 7U, 16U, 31U, 64U, 67U, 133U}) {
      for (const std::size_t count : kCounts) {
        const std::vector<float> row = random_row(random, width + count, 255);
        const std::vector<float> weights = symmetric_weights(random, count);
        const std::vector<float> below = random_row(random, width, 255);
        std::vector<float> out(width + kRowPadding), difference(out);
        symmetric_sum_and_difference(row.data(), count, weights.data(), width, out.data(),
                                     below.data(), difference.data());
        for (std::size_t x = 0; x < width; ++x) {
          double sum = 0;
          for (std::size_t i = 0; i < count; ++i) sum += weights[i] * row[x + i];
          REQUIRE(out[x] == Approx(sum).margin(1e-3));
          REQUIRE(difference[x] == out[x] - below[x]);
        }
      }
    }
  });
}

TEST_CASE("SIFT's columns are summed up, a block of rows at once") {
  on_every_target([] {
    std::mt19937 random(4);
    for (const std::size_t width : {1U, 16U, 31U, 67U}) {
      for (const std::size_t count : kCounts) {
        std::vector<std::vector<float>> rows, out;
        std::vector<const float*> pointers;
        std::vector<float*> targets;
        const std::vector<float> weights = symmetric_weights(random, count);
        for (std::size_t i = 0; i < count + kBlockRows - 1; ++i) {
          rows.push_back(random_row(random, width, 255));
        }
        for (const auto& row : rows) pointers.push_back(row.data());
        out.assign(kBlockRows, std::vector<float>(width + kRowPadding));
        for (auto& row : out) targets.push_back(row.data());
        sum_columns(pointers.data(), count, weights.data(), width, targets.data());
        for (std::size_t j = 0; j < kBlockRows; ++j) {
          for (std::size_t x = 0; x < width; ++x) {
            double sum = 0;
            for (std::size_t i = 0; i < count; ++i) sum += weights[i] * rows[i + j][x];
            REQUIRE(out[j][x] == Approx(sum).margin(1e-3));
          }
        }
      }
    }
  });
}

TEST_CASE("SIFT's rows are read and interleaved") {
  on_every_target([] {
    for (const std::size_t width : {1U, 15U, 16U, 61U}) {
      std::vector<std::uint8_t> bytes(width);
      for (std::size_t x = 0; x < width; ++x) bytes[x] = static_cast<std::uint8_t>(255 - 3 * x);
      std::vector<float> floats(width + kRowPadding), both(2 * width + kRowPadding);
      to_floats(bytes.data(), width, floats.data());
      std::vector<float> odd(floats);
      for (float& v : odd) v += 0.5F;
      interleave(floats.data(), odd.data(), width, both.data());
      for (std::size_t x = 0; x < width; ++x) {
        REQUIRE(floats[x] == bytes[x]);
        REQUIRE(both[2 * x] == bytes[x]);
        REQUIRE(both[2 * x + 1] == bytes[x] + 0.5F);
      }
    }
  });
}

TEST_CASE("SIFT's rows become fixed-point numbers and floats again") {
  on_every_target([] {
    for (const std::size_t width : {1U, 15U, 16U, 61U}) {
      std::vector<float> floats(width + kRowPadding), back(floats);
      for (std::size_t x = 0; x < width; ++x) {
        floats[x] = 255 - 3.7F * static_cast<float>(x);
      }
      std::vector<std::uint16_t> fixed(width + 1, 9);
      to_fixed_point(floats.data(), width, fixed.data());
      from_fixed_point(fixed.data(), width, back.data());
      for (std::size_t x = 0; x < width; ++x) {
        REQUIRE(fixed[x] == std::lround(floats[x] * kLevelUnits));
        REQUIRE(back[x] == static_cast<float>(fixed[x]) / kLevelUnits);
      }
      CHECK(fixed[width] == 9);
      CHECK(back[width] == 0);
    }
  });
}

TEST_CASE("SIFT's extrema of a row are those of the definition, equal neighbours included") {
  on_every_target([] {
    std::mt19937 random(2);
    std::size_t total = 0;
    for (int trial = 0; trial < 40; ++trial) {
      constexpr std::size_t kWidth = 230;
      std::vector<std::vector<float>> rows;
      std::vector<const float*> pointers;
      for (int i = 0; i < 9; ++i) rows.push_back(random_row(random, kWidth, trial % 2 ? 5 : 400));
      for (const auto& row : rows) pointers.push_back(row.data());
      const float threshold = trial % 2 ? 0.5F : 100.F;
      std::vector<float> smallest(kWidth + kRowPadding), largest(smallest);
      float* const least = smallest.data();
      float* const most = largest.data();
      column_ranges(pointers.data(), 1, kWidth, &least, &most);
      for (const std::size_t last : {6U, 100U, 225U}) {
        std::vector<int> expected, found(kWidth);
        for (std::size_t x = 5; x < last; ++x) {
          std::vector<const float*> at;
          for (const float* row : pointers) at.push_back(row + x);
          if (std::abs(rows[4][x]) > threshold && is_extremum(at.data())) {
            expected.push_back(static_cast<int>(x));
          }
        }
        found.resize(find_extrema(pointers.data(), least, most, 5, last, threshold, found.data()));
        REQUIRE(found == expected);
        total += found.size();
      }
    }
    CHECK(total > 100);
  });
}

// An octave in double precision, every level and difference whole.
struct Image {
  int width, height;
  std::vector<double> samples;

  double& at(int x, int y) { return samples[static_cast<std::size_t>(y * width + x)]; }
  double at(int x, int y) const { return samples[static_cast<std::size_t>(y * width + x)]; }
};

Image zeros(int width, int height) {
  return {width, height, std::vector<double>(static_cast<std::size_t>(width * height))};
}

std::vector<double> kernel_of(double sigma, KernelCentre centre) {
  std::vector<float> weights(static_cast<std::size_t>(kernel_size(sigma, centre)));
  make_kernel(sigma, centre, weights.data());
  return {weights.begin(), weights.end()};
}

// Along the rows, at every `1 / per_pixel`-th sample; then the same along the columns.
Image blurred_rows(const Image& image, double sigma, int per_pixel) {
  Image out = zeros(per_pixel * (image.width - 1) + 1, image.height);
  const auto whole = kernel_of(sigma, KernelCentre::kSample);
  const auto half = kernel_of(sigma, KernelCentre::kBetweenSamples);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      const auto& kernel = x % per_pixel ? half : whole;
      const int first = x / per_pixel - (static_cast<int>(kernel.size()) - 1) / 2;
      for (std::size_t i = 0; i < kernel.size(); ++i) {
        out.at(x, y) += kernel[i] * image.at(mirrored(first + static_cast<int>(i), image.width), y);
      }
    }
  }
  return out;
}

Image transposed(const Image& image) {
  Image out = zeros(image.height, image.width);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) out.at(y, x) = image.at(x, y);
  }
  return out;
}

Image blurred(const Image& image, double sigma, int per_pixel) {
  const Image rows = blurred_rows(image, sigma, per_pixel);
  return transposed(blurred_rows(transposed(rows), sigma, per_pixel));
}

std::vector<Image> levels_of(Image first, const SiftOptions& options) {
  std::vector<Image> levels{std::move(first)};
  for (int level = 1; level < options.octave_layers + 3; ++level) {
    const double sigma = level_step_sigma(options.initial_sigma, options.octave_layers, level);
    levels.push_back(blurred(levels.back(), sigma, 1));
  }
  return levels;
}

Image halved(const Image& image) {
  Image out = zeros((image.width + 1) / 2, (image.height + 1) / 2);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) out.at(x, y) = image.at(2 * x, 2 * y);
  }
  return out;
}

std::vector<RefinedExtremum> extrema_of(const std::vector<Image>& levels,
                                        const SiftOptions& options) {
  const Image& first = levels.front();
  std::vector<std::vector<float>> differences;
  for (std::size_t k = 0; k + 1 < levels.size(); ++k) {
    std::vector<float> difference;
    for (std::size_t i = 0; i < first.samples.size(); ++i) {
      difference.push_back(static_cast<float>(levels[k + 1].samples[i] - levels[k].samples[i]));
    }
    differences.push_back(std::move(difference));
  }
  const auto rows_at = [&](int layer, int y, int x, const float** rows) {
    for (int i = 0; i < 9; ++i) {
      rows[i] = differences[static_cast<std::size_t>(layer + i / 3 - 1)].data() +
                (y + i % 3 - 1) * first.width + x;
    }
  };
  const auto threshold = static_cast<float>(options.contrast_threshold);
  const ExtremumLimits limits{options.octave_layers, first.height, first.width, threshold,
                              static_cast<float>(options.edge_threshold)};
  std::vector<RefinedExtremum> extrema;
  for (int layer = 1; layer <= options.octave_layers; ++layer) {
    for (int y = kBorder; y < first.height - kBorder; ++y) {
      for (int x = kBorder; x < first.width - kBorder; ++x) {
        const float* rows[9];
        rows_at(layer, y, x, rows);
        RefinedExtremum refined;
        if (std::abs(rows[4][0]) <= kSampleContrast * threshold || !is_extremum(rows) ||
            !refine_extremum(rows_at, limits, layer, y, x, &refined)) {
          continue;
        }
        extrema.push_back(refined);
      }
    }
  }
  return extrema;
}

// How many of `some` have one of the same place among `others`.
template <typename Others>
std::size_t matched(const std::vector<RefinedExtremum>& some, const Others& others, int octave) {
  std::size_t count = 0;
  for (const RefinedExtremum& e : some) {
    count += std::any_of(others.begin(), others.end(), [&](const Extremum& other) {
      return other.octave == octave &&
             std::hypot(static_cast<float>(e.x) + e.to_x - other.level_x,
                        static_cast<float>(e.y) + e.to_y - other.level_y) < 0.01 &&
             std::abs(e.response - other.response) < 0.01;
    });
  }
  return count;
}

TEST_CASE("SIFT's scale space is that of the definition") {
  struct Size {
    int width, height;
  };
  for (const int layers : {3, 1, 4}) {
    SiftOptions options;
    options.octave_layers = layers;
    options.upsample = GENERATE(false, true);
    options.contrast_threshold = 0.5;
    ScaleSpace scale_space(options);
    for (const Size size : {Size{90, 61}, Size{64, 48}, Size{11, 130}, Size{75, 12}}) {
      INFO(size.width << " x " << size.height << ", " << layers << " layers");
      const GrayImage image = texture(size.width, size.height, 3);
      on_every_target([&] {
        const std::vector<Extremum>& found = scale_space.detect(image);
        const double sigma = first_level_sigma(options.initial_sigma, options.upsample);
        Image first = zeros(size.width, size.height);
        std::copy(image.pixels.begin(), image.pixels.end(), first.samples.begin());
        first = blurred(first, sigma, options.upsample ? 2 : 1);
        std::size_t count = 0;
        for (int octave = 0; std::min(first.width, first.height) >= kMinOctaveSize; ++octave) {
          const std::vector<Image> levels = levels_of(first, options);
          double largest = 0;
          for (int level = 1; level <= layers; ++level) {
            const FixedLevel view = scale_space.level(octave, level);
            REQUIRE(view.width == first.width);
            REQUIRE(view.height == first.height);
            const Image& expected = levels[static_cast<std::size_t>(level)];
            for (int y = 0; y < first.height; ++y) {
              for (int x = 0; x < first.width; ++x) {
                const float here = view.samples[y * view.stride + x] / kLevelUnits;
                largest = std::max(largest, std::abs(here - expected.at(x, y)));
              }
            }
          }
          CHECK(largest < 0.5 / kLevelUnits + 1e-3);
          const std::vector<RefinedExtremum> expected = extrema_of(levels, options);
          // Rounding decides a few.
          CHECK(matched(expected, found, octave) + 1 + expected.size() / 100 >= expected.size());
          count += expected.size();
          first = halved(levels[static_cast<std::size_t>(layers)]);
        }
        CHECK(std::abs(static_cast<double>(found.size()) - static_cast<double>(count)) <=
              2 + static_cast<double>(count) / 100);
        if (size.width == 90) CHECK(count > 5);
      });
    }
  }
}

TEST_CASE("SIFT's extrema are told once") {
  SiftOptions options;
  options.contrast_threshold = 0;
  ScaleSpace scale_space(options);
  const std::vector<Extremum> extrema = scale_space.detect(texture(200, 160, 8));
  REQUIRE(extrema.size() > 400);
  for (std::size_t i = 1; i < extrema.size(); ++i) {
    const Extremum& a = extrema[i - 1];
    const Extremum& b = extrema[i];
    REQUIRE((a.octave != b.octave || a.x != b.x || a.y != b.y || a.scale != b.scale));
  }
}

}  // namespace
}  // namespace hybrid_slam::sift
