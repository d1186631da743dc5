#pragma once

#include <string>

namespace hybrid_slam {

// What a learned network takes and gives: a YAML file beside its ONNX file. docs/feature_study.md
// has each key.
struct OnnxContract {
  enum class Kind { kPatchDescriptor, kDenseDetector };
  enum class Scores {
    kCells,  // cell * cell + 1 channels: a softmax over the pixels of a cell, and over "none"
    kMap     // one channel, a score per pixel
  };

  std::string name;   // in tables
  std::string model;  // path of the ONNX file
  Kind kind = Kind::kPatchDescriptor;

  // The input is one channel of (grey * scale - mean) / deviation. With `per_patch` each patch
  // then loses its own mean and is divided by its own standard deviation.
  int width = 32;   // [px]; of a dense detector 0: that of the image
  int height = 32;  // [px]
  double scale = 1;
  double mean = 0;
  double deviation = 1;
  bool per_patch = false;

  int length = 0;      // numbers of a descriptor
  bool unit = true;    // descriptors are brought to length 1 ("cosine"), else left ("l2")
  double ratio = 0.8;  // of the ratio test

  // Patches: at our SIFT's keypoints, turned by their angle.
  double patch_scales = 12;  // side of a patch in the keypoint's scale, as SIFT's own descriptor
  int batch = 1;             // patches at a time

  // Dense detectors.
  Scores scores = Scores::kCells;
  int cell = 8;  // side of a cell [px]; the input's sides are multiples of it
  double threshold = 0.015;
  int radius = 4;  // [px] within which the strongest keypoint is kept
  int border = 4;  // [px] of the input without keypoints
};

// Throws InputError of one line, with file and line, if the file cannot be read, a key is unknown
// or missing, or a value cannot be used. Does not look at the ONNX file.
OnnxContract read_onnx_contract(const std::string& path);

}  // namespace hybrid_slam
