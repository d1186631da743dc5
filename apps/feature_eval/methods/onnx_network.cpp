#include "apps/feature_eval/methods/onnx_network.h"

#include <filesystem>
#include <utility>

#include <opencv2/core/utils/logger.hpp>

#include "cameras/files/input_error.h"
#include "frontend/input/text_file.h"

namespace hybrid_slam {
namespace {

// OpenCV's reason without its place in the source, in one line.
std::string reason_of(const cv::Exception& error) {
  std::string reason = error.err.empty() ? error.msg : error.err;
  for (char& c : reason) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  constexpr std::size_t kMost = 200;
  if (reason.size() > kMost) reason = reason.substr(0, kMost) + " ...";
  while (!reason.empty() && reason.back() == ' ') reason.pop_back();
  return reason;
}

}  // namespace

std::string shape_text(const cv::Mat& blob) {
  std::string text;
  for (int i = 0; i < blob.dims; ++i) {
    if (i > 0) text += 'x';
    text += std::to_string(blob.size[i]);
  }
  return text;
}

OnnxNetwork::OnnxNetwork(std::string path) : path_(std::move(path)) {
  if (!std::filesystem::exists(path_)) throw InputError(path_ + ": no such ONNX file");
  const std::string file = read_file(path_);
  if (file.empty()) throw InputError(path_ + ": empty ONNX file");
  cv::setNumThreads(1);
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);  // we say it in one line
  try {
    net_ = cv::dnn::readNetFromONNX(file.data(), file.size());
    if (net_.empty()) throw InputError(path_ + ": not an ONNX file, or a network without layers");
    net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
    net_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
    outputs_ = net_.getUnconnectedOutLayersNames();
  } catch (const cv::Exception& error) {
    throw InputError(path_ + ": not an ONNX file that OpenCV can read: " + reason_of(error));
  }
  if (outputs_.empty()) throw InputError(path_ + ": a network without outputs");
}

std::vector<cv::Mat> OnnxNetwork::run(const cv::Mat& input) {
  std::vector<cv::Mat> outputs;
  try {
    net_.setInput(input);
    net_.forward(outputs, outputs_);
  } catch (const cv::Exception& error) {
    throw InputError(path_ + ": does not take an input of " + shape_text(input) + ": " +
                     reason_of(error));
  }
  for (const cv::Mat& output : outputs) {
    if (output.type() != CV_32F) refuse(input, outputs, "which are no floats");
  }
  return outputs;
}

void OnnxNetwork::refuse(const cv::Mat& input, const std::vector<cv::Mat>& outputs,
                         const std::string& reason) const {
  std::string shapes;
  for (const cv::Mat& output : outputs) {
    if (!shapes.empty()) shapes += ", ";
    shapes += shape_text(output);
  }
  throw InputError(path_ + ": gives " + shapes + " for an input of " + shape_text(input) + ", " +
                   reason);
}

}  // namespace hybrid_slam
