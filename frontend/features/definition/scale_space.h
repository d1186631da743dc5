#pragma once

#include <cmath>

#include "frontend/features/definition/parameters.h"

// How the levels of the scale space are made. Kernels are computed once, on the host.

namespace hybrid_slam::sift {

// The sample that stands in for sample i, outside of 0 .. size - 1: the image mirrored at its first
// and last sample, which are not repeated.
HS_HOST_DEVICE inline int mirrored(int i, int size) {
  if (size == 1) return 0;
  while (i < 0 || i >= size) i = i < 0 ? -i : 2 * (size - 1) - i;
  return i;
}

// Samples along a side of octave `octave` (-1: upsampled) of an image with `size` pixels.
HS_HOST_DEVICE inline int octave_size(int size, int octave) {
  if (octave < 0) return 2 * size - 1;
  return (size + (1 << octave) - 1) >> octave;
}

// Blur of level `level` (differences: of the lower one; between layers: a fraction) [samples].
HS_HOST_DEVICE inline float level_sigma(float initial_sigma, int layers, float level) {
  return initial_sigma * exp2f(level / static_cast<float>(layers));
}

// Blur that makes level `level` from the one below it [samples].
inline double level_step_sigma(double initial_sigma, int layers, int level) {
  const double below = initial_sigma * std::exp2((level - 1.0) / layers);
  return below * std::sqrt(std::exp2(2.0 / layers) - 1);
}

// Blur that makes the first level of the first octave from the image [px].
inline double first_level_sigma(double initial_sigma, bool upsample) {
  const double wanted = upsample ? initial_sigma / 2 : initial_sigma;
  const double least = upsample ? kMinBlur / 2 : kMinBlur;
  const double added = wanted * wanted - kImageBlur * kImageBlur;
  return std::sqrt(added > least * least ? added : least * least);
}

// Weights around a sample, or around the middle between two.
enum class KernelCentre { kSample, kBetweenSamples };

// How many weights a kernel of this standard deviation has: odd at a sample, even between two.
inline int kernel_size(double sigma, KernelCentre centre) {
  const int reach = static_cast<int>(std::ceil(kKernelSigmas * sigma));
  return centre == KernelCentre::kSample ? 2 * reach + 1 : 2 * (reach + 1);
}

// weights[0 .. kernel_size - 1], symmetric, sum 1: a sampled and truncated Gaussian whose own width
// is chosen so that the variance of the weights is sigma^2, as far as so many can have it. So blurs
// add up as they should, and interpolation between samples blurs no more than at a sample.
inline void make_kernel(double sigma, KernelCentre centre, float* weights) {
  const int size = kernel_size(sigma, centre);
  const double middle = (size - 1) / 2.0;
  const auto weight = [&](int i, double width) {
    return std::exp(-(i - middle) * (i - middle) / (2 * width * width));
  };
  double low = 0.1;
  double high = 4 * sigma + 1;
  for (int iteration = 0; iteration < 60; ++iteration) {
    const double width = (low + high) / 2;
    double sum = 0;
    double variance = 0;
    for (int i = 0; i < size; ++i) {
      sum += weight(i, width);
      variance += weight(i, width) * (i - middle) * (i - middle);
    }
    (variance < sigma * sigma * sum ? low : high) = width;
  }
  double sum = 0;
  for (int i = 0; i < size; ++i) sum += weight(i, low);
  for (int i = 0; i < size; ++i) weights[i] = static_cast<float>(weight(i, low) / sum);
}

}  // namespace hybrid_slam::sift
