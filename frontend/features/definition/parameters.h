#pragma once

// What SIFT is here, once for every engine: this folder holds the conventions, the constants and
// the arithmetic of each step as functions without state. Plain C++ that compiles for a host and,
// by nvcc, for a device; the why and the measured tables are in docs/sift.md.
//
//   image          grey levels 0..255; the centre of its first pixel is (0, 0); it carries a blur
//   of
//                  kImageBlur already
//   octave o       0, 1, ..., and -1 where the image is upsampled: sample i of a row or a column
//   lies
//                  at pixel i * 2^o of the image, without any offset. Halving keeps every other
//                  sample, from the first. Octaves end where a side gets shorter than
//                  kMinOctaveSize.
//   level k        0 .. layers + 2: blurred to initial_sigma * 2^(k / layers), in samples
//   difference k   level k + 1 less level k; its extrema over k, y and x are the features of scale
//                  initial_sigma * 2^(k / layers) samples, for k = 1 .. layers
//   angle          of the brightness gradient, from +x towards +y
//   descriptor     [row of cells][column of cells][orientation], the columns along the angle

#ifdef __CUDACC__
#define HS_HOST_DEVICE __host__ __device__
#else
#define HS_HOST_DEVICE
#endif

namespace hybrid_slam::sift {

// Scale space.
constexpr int kLayers = 3;             // scales per octave at which features are found
constexpr double kInitialSigma = 1.6;  // blur of the first level of an octave [samples]
constexpr double kImageBlur =
    0.3;  // that the image is taken to carry [px]; a pixel's own area makes 0.29
constexpr double kMinBlur = 0.1;       // [samples] the least that is added to the image
constexpr double kKernelSigmas = 3.0;  // a kernel reaches so many standard deviations

// Extrema.
constexpr double kContrastThreshold = 1.2;  // smallest |difference| [grey levels]
constexpr double kEdgeThreshold = 10;       // largest ratio of principal curvatures
constexpr float kSampleContrast = 0.5F;  // of the threshold, which a sample must exceed before it
                                         // is interpolated
constexpr int kBorder = 5;               // [samples] along the image's sides without features
constexpr int kMinOctaveSize = 2 * kBorder + 1;  // [samples]
constexpr int kMaxMoves = 2;                     // of an extremum to a neighbour that fits better
constexpr float kMaxOffset = 0.6F;  // [samples, layers] from the sample that it is fitted at

// Orientations. Samples lie on a square grid around the feature, every kOrientationStep scales.
constexpr int kOrientationBins = 36;
constexpr int kOrientationRadius = 6;      // [grid steps]
constexpr float kOrientationStep = 0.75F;  // [scales of the feature]
constexpr float kOrientationSigma = 2.0F;  // of the Gaussian window [grid steps]
constexpr float kSecondPeak = 0.8F;        // of the highest, from which a bin counts as well
constexpr int kMaxOrientations = 4;        // of one extremum

// Descriptor. Samples lie on a square grid turned by the angle, kSamplesPerCell to a cell's side.
constexpr int kCells = 4;           // along a side
constexpr int kDescriptorBins = 8;  // orientations per cell
constexpr int kDescriptorSize = kCells * kCells * kDescriptorBins;
constexpr float kCellSize = 3.0F;  // [scales of the feature]
constexpr int kSamplesPerCell = 4;
constexpr float kDescriptorSigma = 2.0F;  // of the Gaussian window [cells]
constexpr float kClip = 0.2F;             // largest part of the length that one number may have
constexpr float kQuantum = 512.0F;        // length of the descriptor in bytes

}  // namespace hybrid_slam::sift
