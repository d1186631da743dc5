#include "apps/scene_renderer/film.h"

#include <algorithm>
#include <cmath>

#include "apps/scene_renderer/noise.h"
#include "apps/scene_renderer/rows.h"
#include "apps/scene_renderer/shot_noise.h"

namespace hybrid_slam {
namespace {

float luminance(const Color& color) {
  return 0.25F * color[0] + 0.6F * color[1] + 0.15F * color[2];
}

std::vector<float> blur_weights(float sigma) {
  const int radius = std::max(1, static_cast<int>(std::ceil(3 * sigma)));
  std::vector<float> weights;
  float sum = 0;
  for (int i = -radius; i <= radius; ++i) {
    const float q = static_cast<float>(i) / std::max(sigma, 1e-3F);
    weights.push_back(std::exp(-0.5F * q * q));
    sum += weights.back();
  }
  for (float& weight : weights) weight /= sum;
  return weights;
}

// One direction of a Gaussian blur; the border's pixels go on beyond it.
std::vector<Color> blurred(const std::vector<Color>& pixels, int width, int height, bool along_x,
                           const std::vector<float>& weights, int threads) {
  std::vector<Color> result(pixels.size());
  const int radius = static_cast<int>(weights.size() / 2);
  for_rows(height, threads, [&](int y) {
    for (int x = 0; x < width; ++x) {
      Color sum = Color::Zero();
      for (int i = -radius; i <= radius; ++i) {
        const int from_x = along_x ? std::clamp(x + i, 0, width - 1) : x;
        const int from_y = along_x ? y : std::clamp(y + i, 0, height - 1);
        sum += weights[static_cast<std::size_t>(i + radius)] *
               pixels[static_cast<std::size_t>(from_y * width + from_x)];
      }
      result[static_cast<std::size_t>(y * width + x)] = sum;
    }
  });
  return result;
}

// Light that the lens lets through at a pixel: less towards the corners, or towards the border of a
// fisheye's circle, which the light of pixels beyond does not reach.
float lens_at(const ViewRays& rays, int x, int y, float vignetting) {
  const float dx = 2 * static_cast<float>(x) / static_cast<float>(rays.width) - 1;
  const float dy = 2 * static_cast<float>(y) / static_cast<float>(rays.height) - 1;
  return 1 - vignetting * 0.5F * (dx * dx + dy * dy);
}

// About Gaussian, mean 0, standard deviation 1: the sum of the four bytes.
float noise_of(std::uint32_t bits) {
  const std::uint32_t sum =
      (bits & 255U) + ((bits >> 8) & 255U) + ((bits >> 16) & 255U) + (bits >> 24);
  return (static_cast<float>(sum) - 510) / 147.8F;
}

// A share of full scale as so many electrons make it.
float counted(float linear, const FilmOptions& options, std::uint32_t bits) {
  const float electrons =
      poisson(options.photons * linear, bits) + options.read_noise * gaussian(~bits);
  return std::clamp(electrons / options.photons, 0.0F, 1.0F);
}

std::vector<float> make_gamma() {  // of 0 to 1 in 4096 steps, in grey levels
  std::vector<float> gamma(4097);
  for (std::size_t i = 0; i < gamma.size(); ++i) {
    gamma[i] = 255 * std::pow(static_cast<float>(i) / 4096, 1 / 2.2F);
  }
  return gamma;
}

}  // namespace

float exposure_for(const RadianceImage& image, const ViewRays& rays, const FilmOptions& options) {
  std::vector<float> sample;
  for (std::size_t pixel = 0; pixel < image.pixels.size(); pixel += 17) {
    if (rays.sees(pixel)) sample.push_back(luminance(image.pixels[pixel]));
  }
  if (sample.empty()) return 1;
  const auto at = sample.begin() + static_cast<std::ptrdiff_t>(sample.size() * 9 / 10);
  std::nth_element(sample.begin(), at, sample.end());
  return options.bright / std::max(*at, 1e-6F);
}

ColorImage develop(const RadianceImage& image, const ViewRays& rays, float exposure,
                   const FilmOptions& options, std::uint32_t seed, int threads) {
  static const std::vector<float> gamma = make_gamma();
  const std::vector<float> weights = blur_weights(options.blur);
  std::vector<Color> light =
      blurred(image.pixels, image.width, image.height, true, weights, threads);
  light = blurred(light, image.width, image.height, false, weights, threads);
  ColorImage picture{image.width, image.height, {}};
  picture.pixels.assign(3 * image.pixels.size(), 0);
  for_rows(image.height, threads, [&](int y) {
    auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width);
    for (int x = 0; x < image.width; ++x, ++pixel) {
      if (!rays.sees(pixel)) continue;
      const float factor = exposure * lens_at(rays, x, y, options.vignetting);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        const float full = factor * light[pixel][2 - static_cast<int>(channel)];
        float linear = std::clamp(full, 0.0F, 1.0F);
        if (options.photons > 0) {
          linear = counted(std::max(full, 0.0F), options,
                           mixed_bits(x, y, static_cast<int>(channel) + 20, seed));
        }
        const std::uint32_t bits = mixed_bits(x, y, static_cast<int>(channel) + 10, seed);
        const float grey =
            gamma[static_cast<std::size_t>(4096 * linear)] + options.noise * noise_of(bits);
        picture.pixels[3 * pixel + channel] =
            static_cast<std::uint8_t>(std::clamp(grey + 0.5F, 0.0F, 255.0F));
      }
    }
  });
  return picture;
}

}  // namespace hybrid_slam
