#pragma once

#include <array>
#include <cstdint>
#include <vector>

// Plain types only: the CUDA side includes this header.

namespace hybrid_slam {

// A feature's place in an image. Pixel origin: the centre of the first pixel is (0, 0).
struct Keypoint {
  float x = 0;         // [px]
  float y = 0;         // [px]
  float scale = 0;     // SIFT's Gaussian sigma in the image [px]
  float angle = 0;     // [rad], in [0, 2 pi), from +x towards +y
  float response = 0;  // |difference of Gaussians|, grey levels 0..255
  float sigma = 1;     // standard deviation of x and of y [px]; grows with the scale
};

// 128 bytes: the square root of the L1-normalised SIFT histogram times 512, rounded (RootSIFT).
using Descriptor = std::array<std::uint8_t, 128>;

// Which extractor a descriptor comes from. Kinds are never compared with one another.
enum class DescriptorKind : std::uint8_t {
  kNone = 0,
  kRootSiftOpenCv = 1,  // by OpenCV's SIFT
  kSynthetic = 2,
  kRootSift = 3,   // by ours: frontend/features/definition
  kPlainSift = 4,  // L2-normalised, of other programs; in bytes times 512. In vocabularies only
};

// keypoints[i] and descriptors[i] belong together.
struct FeatureSet {
  DescriptorKind kind = DescriptorKind::kNone;
  std::vector<Keypoint> keypoints;
  std::vector<Descriptor> descriptors;

  std::size_t size() const { return keypoints.size(); }
};

}  // namespace hybrid_slam
