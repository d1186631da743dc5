#pragma once

#include <memory>

#include "apps/feature_eval/feature_method.h"
#include "apps/feature_eval/methods/onnx_contract.h"

namespace hybrid_slam {

// The network of a contract as a way to find and describe features, tried once. Patches are those
// of SIFT by `sift` (our engine for the CPU); a dense detector keeps `sift.max_features`. Throws
// InputError of one line if the ONNX file cannot be read or does not keep the contract.
std::unique_ptr<FeatureMethod> make_onnx_method(const OnnxContract& contract,
                                                const SiftOptions& sift);

// The parts of it, for tests.

// The pixels of a patch around a keypoint: its x axis along the keypoint's angle, width x height
// samples with its middle at the keypoint. The image is blurred where samples are more than 2 px
// apart, and goes on beyond its border as it is there. Row by row, grey levels.
std::vector<float> cut_patch(const GrayImage& image, const Keypoint& keypoint,
                             const OnnxContract& contract);

// Scores of each pixel of the input, row by row, from the network's output: a softmax over cells,
// or a map as it is.
struct ScoreMap {
  int width = 0;
  int height = 0;
  std::vector<float> values;
};
ScoreMap scores_of_cells(const float* output, int cell, int cells_wide, int cells_high);

// Pixels with a score of at least the contract's threshold that are the highest within its radius
// (a square; of equal ones the first by row), and not on its border: strongest first, as keypoints
// in the input's pixels.
std::vector<Keypoint> peaks(const ScoreMap& scores, const OnnxContract& contract);

// A unit vector, or the numbers as they are.
void finish_descriptor(float* values, const OnnxContract& contract);

std::unique_ptr<FeatureMethod> make_patch_method(const OnnxContract& contract,
                                                 const SiftOptions& sift);
std::unique_ptr<FeatureMethod> make_dense_method(const OnnxContract& contract, int max_features);

}  // namespace hybrid_slam
