#pragma once

#include <string>
#include <vector>

#include <opencv2/core.hpp>
#include <opencv2/dnn.hpp>

namespace hybrid_slam {

// "1x65x30x40"
std::string shape_text(const cv::Mat& blob);

// A network of an ONNX file, run by OpenCV on one thread of the CPU. For one thread at a time.
class OnnxNetwork {
 public:
  // Throws InputError of one line if the file is missing, not ONNX, or has operations that OpenCV
  // does not know.
  explicit OnnxNetwork(std::string path);

  // All outputs for `input`: [batch][channel][row][column], floats. They are the network's memory
  // until the next call. Throws InputError if the network does not take it.
  std::vector<cv::Mat> run(const cv::Mat& input);

  // "path: gives 1x64, 1x1x2x2 for an input of 1x1x32x32, <reason>"
  [[noreturn]] void refuse(const cv::Mat& input, const std::vector<cv::Mat>& outputs,
                           const std::string& reason) const;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
  cv::dnn::Net net_;
  std::vector<std::string> outputs_;
};

}  // namespace hybrid_slam
