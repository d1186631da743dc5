#pragma once

#include <cmath>

#include "frontend/features/definition/parameters.h"

// What the noise of an image leaves in the differences of Gaussians, by which extrema are told from
// it.

namespace hybrid_slam::sift {

// White noise in an image that was smoothed since. In pixels as it is given for an image, in
// samples as the definition has it for an octave.
struct ImageNoise {
  float deviation = 0;  // standard deviation before smoothing [grey levels]; 0: nothing to speak of
  float smoothing = 0;  // standard deviation of the Gaussian that smoothed it [px]
};

// The same in an octave whose samples are so many pixels apart. Noise that lies between samples is
// averaged where they are sparser: a Gaussian of standard deviation s leaves 1 / (2 sqrt(pi) s).
HS_HOST_DEVICE inline ImageNoise noise_in_octave(const ImageNoise& noise, float pixels) {
  return {noise.deviation / pixels, noise.smoothing / pixels};
}

// Standard deviation of a difference of Gaussians in noise alone: of two that share their noise, of
// variances a < b, by the product of Gaussians 1 / (4 pi) (1 / a + 1 / b - 4 / (a + b)).
HS_HOST_DEVICE inline float difference_noise(const ImageNoise& noise, float scale, int layers) {
  const float smoothed = noise.smoothing * noise.smoothing;
  const float a = scale * scale + smoothed;
  const float b = scale * scale * exp2f(2.0F / static_cast<float>(layers)) + smoothed;
  return noise.deviation * (b - a) / sqrtf(4 * 3.14159265F * a * b * (a + b));
}

// What differences are multiplied by before they meet the contrast threshold, and before they are
// compared with one another as responses: so that the default threshold is kNoiseDeviations of the
// noise at every scale. For noise to speak of.
HS_HOST_DEVICE inline float response_gain(const ImageNoise& noise, float scale, int layers) {
  return static_cast<float>(kContrastThreshold) /
         (kNoiseDeviations * difference_noise(noise, scale, layers));
}

}  // namespace hybrid_slam::sift
