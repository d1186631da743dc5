#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace hybrid_slam {

// Small networks as ONNX files, so that tests need neither Python nor a network of somebody else.
// Only what they use of the format (onnx.proto3): floats, and attributes of whole numbers.

struct OnnxTensor {
  std::string name;
  std::vector<int> shape;
  std::vector<float> values;  // of an input or an output: none
};

struct OnnxNode {
  std::string operation;
  std::vector<std::string> inputs;
  std::vector<std::string> outputs;
  std::vector<std::pair<std::string, std::vector<int>>> attributes;  // lists
  std::vector<std::pair<std::string, int>> numbers;                  // single numbers
};

struct OnnxGraph {
  std::vector<OnnxNode> nodes;
  std::vector<OnnxTensor> constants;
  std::vector<OnnxTensor> inputs;
  std::vector<OnnxTensor> outputs;
};

// The bytes of an ONNX file, operator set 11.
std::string onnx_bytes(const OnnxGraph& graph);

// Means of blocks of `block_width` x `block_height` pixels of a patch, row by row.
OnnxGraph block_means(int batch, int width, int height, int block_width, int block_height);

// A dense detector over cells of 8 pixels: the score of each pixel is its value, that of "none" is
// `none`; two descriptor channels: the first pixel of each cell, and 1.
OnnxGraph cell_detector(int width, int height, float none);

// A dense detector whose score is the pixel itself; one descriptor channel, likewise.
OnnxGraph map_detector(int width, int height);

}  // namespace hybrid_slam
