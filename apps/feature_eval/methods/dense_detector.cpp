#include <algorithm>
#include <cmath>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/feature_eval/methods/onnx_methods.h"
#include "apps/feature_eval/methods/onnx_network.h"

namespace hybrid_slam {
namespace {

constexpr int kProbeCells = 8;  // sides of the input that is tried where the contract has no size

// An input as the network takes it, and how its pixels lie in the image:
// image = (input + 0.5) / zoom - 0.5.
struct NetworkInput {
  cv::Mat blob;
  double zoom = 1;
  int width = 0, height = 0;  // [px] that show the image; beyond it is black
};

class DenseMethod final : public FeatureMethod {
 public:
  DenseMethod(const OnnxContract& contract, int max_features)
      : FeatureMethod(contract.ratio),
        contract_(contract),
        network_(contract.model),
        max_features_(static_cast<std::size_t>(max_features)) {
    const int probe = kProbeCells * contract.cell;
    const int width = contract.width > 0 ? contract.width : probe;
    const int height = contract.height > 0 ? contract.height : probe;
    run(cv::Mat(std::vector<int>{1, 1, height, width}, CV_32F, cv::Scalar(0)));
  }

  DescribedFeatures extract(const GrayImage& image, const GrayImage* mask,
                            StageTimes& times) override {
    StageClock whole(times), stage(times);
    DescribedFeatures features;
    FloatDescriptors descriptors{contract_.length, {}};
    const NetworkInput input = prepare(image);
    if (input.width > 0 && input.height > 0) {
      const Outputs outputs = run(input.blob);
      stage.lap("network");
      for (const Keypoint& found : peaks(outputs.scores, contract_)) {
        if (found.x >= static_cast<float>(input.width - contract_.border) ||
            found.y >= static_cast<float>(input.height - contract_.border)) {
          continue;
        }
        const Keypoint placed = in_image(found, input.zoom);
        if (mask != nullptr && !is_open(*mask, placed)) continue;
        features.keypoints.push_back(placed);
        append_descriptor(outputs.descriptors, input.blob, found, descriptors.values);
        if (features.size() == max_features_) break;
      }
    }
    features.descriptors = std::move(descriptors);
    stage.lap("keypoints");
    whole.lap(kTotal);
    return features;
  }

 private:
  struct Outputs {
    ScoreMap scores;
    cv::Mat descriptors;  // [1][length][row][column]
  };

  NetworkInput prepare(const GrayImage& image) const {
    const cv::Mat pixels(image.height, image.width, CV_8UC1,
                         const_cast<std::uint8_t*>(image.pixels.data()));
    NetworkInput input;
    cv::Mat fitted;
    int width = contract_.width, height = contract_.height;
    if (width == 0) {  // what does not fill a cell is left out
      width = image.width / contract_.cell * contract_.cell;
      height = image.height / contract_.cell * contract_.cell;
      input.width = width;
      input.height = height;
      if (width == 0 || height == 0) return input;
      fitted = pixels({0, 0, width, height});
    } else {
      input.zoom = std::min(static_cast<double>(width) / image.width,
                            static_cast<double>(height) / image.height);
      input.width = std::clamp(static_cast<int>(std::lround(input.zoom * image.width)), 1, width);
      input.height =
          std::clamp(static_cast<int>(std::lround(input.zoom * image.height)), 1, height);
      cv::resize(pixels, fitted, {input.width, input.height}, 0, 0,
                 input.zoom < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    }
    cv::Mat values(height, width, CV_32F, cv::Scalar(0));
    fitted.convertTo(values({0, 0, input.width, input.height}), CV_32F);
    values = (values * contract_.scale - contract_.mean) / contract_.deviation;
    input.blob = values.reshape(1, {1, 1, height, width}).clone();
    return input;
  }

  static Keypoint in_image(const Keypoint& found, double zoom) {
    Keypoint keypoint = found;
    keypoint.x = static_cast<float>((found.x + 0.5) / zoom - 0.5);
    keypoint.y = static_cast<float>((found.y + 0.5) / zoom - 0.5);
    keypoint.scale = static_cast<float>(1 / zoom);
    return keypoint;
  }

  static bool is_open(const GrayImage& mask, const Keypoint& keypoint) {
    const int x = std::clamp(static_cast<int>(std::lround(keypoint.x)), 0, mask.width - 1);
    const int y = std::clamp(static_cast<int>(std::lround(keypoint.y)), 0, mask.height - 1);
    return mask.row(y)[x] != 0;
  }

  // Tells the outputs by their channels.
  Outputs run(const cv::Mat& input) {
    const std::vector<cv::Mat> blobs = network_.run(input);
    const bool cells = contract_.scores == OnnxContract::Scores::kCells;
    const int cell = contract_.cell, width = input.size[3], height = input.size[2];
    const int channels = cells ? cell * cell + 1 : 1;
    const auto is = [](const cv::Mat& blob, int wanted) {
      return blob.dims == 4 && blob.size[0] == 1 && blob.size[1] == wanted;
    };
    const auto scores = std::find_if(blobs.begin(), blobs.end(), [&](const cv::Mat& blob) {
      const int shrink = cells ? cell : 1;
      return is(blob, channels) && blob.size[2] == height / shrink &&
             blob.size[3] == width / shrink;
    });
    const auto descriptors = std::find_if(blobs.begin(), blobs.end(), [&](const cv::Mat& blob) {
      return is(blob, contract_.length) &&
             blob.data != (scores == blobs.end() ? nullptr : scores->data);
    });
    if (scores == blobs.end()) {
      network_.refuse(input, blobs,
                      "without scores of 1x" + std::to_string(channels) + "x" +
                          std::to_string(cells ? height / cell : height) + "x" +
                          std::to_string(cells ? width / cell : width));
    }
    if (descriptors == blobs.end()) {
      network_.refuse(
          input, blobs,
          "without descriptors of 1x" + std::to_string(contract_.length) + "xROWSxCOLUMNS");
    }
    const float* const values = scores->ptr<float>();
    return {cells ? scores_of_cells(values, cell, width / cell, height / cell)
                  : ScoreMap{width, height, {values, values + scores->total()}},
            *descriptors};
  }

  // Between the four nearest places of the coarse map, whose first one is the middle of the first
  // cell.
  void append_descriptor(const cv::Mat& map, const cv::Mat& input, const Keypoint& keypoint,
                         std::vector<float>& values) const {
    const int rows = map.size[2], columns = map.size[3];
    const auto along = [](float place, int size, int cells, int& first) {
      const double at = std::clamp((place + 0.5) * cells / size - 0.5, 0.0, cells - 1.0);
      first = std::min(static_cast<int>(at), std::max(cells - 2, 0));
      return at - first;
    };
    int x = 0, y = 0;
    const double right = along(keypoint.x, input.size[3], columns, x);
    const double down = along(keypoint.y, input.size[2], rows, y);
    const int x1 = std::min(x + 1, columns - 1), y1 = std::min(y + 1, rows - 1);
    for (int c = 0; c < contract_.length; ++c) {
      const auto at = [&](int row, int column) {
        return static_cast<double>(map.ptr<float>(0, c)[row * columns + column]);
      };
      values.push_back(
          static_cast<float>((1 - down) * ((1 - right) * at(y, x) + right * at(y, x1)) +
                             down * ((1 - right) * at(y1, x) + right * at(y1, x1))));
    }
    finish_descriptor(&*(values.end() - contract_.length), contract_);
  }

  OnnxContract contract_;
  OnnxNetwork network_;
  std::size_t max_features_;
};

}  // namespace

ScoreMap scores_of_cells(const float* output, int cell, int cells_wide, int cells_high) {
  ScoreMap scores{cells_wide * cell, cells_high * cell, {}};
  scores.values.resize(static_cast<std::size_t>(scores.width) *
                       static_cast<std::size_t>(scores.height));
  const int plane = cells_wide * cells_high, channels = cell * cell + 1;
  for (int i = 0; i < plane; ++i) {
    float highest = output[i];
    for (int c = 1; c < channels; ++c) highest = std::max(highest, output[c * plane + i]);
    double sum = 0;
    for (int c = 0; c < channels; ++c) sum += std::exp(output[c * plane + i] - highest);
    const int left = i % cells_wide * cell, top = i / cells_wide * cell;
    for (int c = 0; c + 1 < channels; ++c) {
      const int at = (top + c / cell) * scores.width + left + c % cell;
      scores.values[static_cast<std::size_t>(at)] =
          static_cast<float>(std::exp(output[c * plane + i] - highest) / sum);
    }
  }
  return scores;
}

std::vector<Keypoint> peaks(const ScoreMap& scores, const OnnxContract& contract) {
  const auto at = [&](int x, int y) {
    return scores.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(scores.width) +
                         static_cast<std::size_t>(x)];
  };
  const auto beaten = [&](int x, int y) {
    const float here = at(x, y);
    for (int v = std::max(y - contract.radius, 0);
         v <= std::min(y + contract.radius, scores.height - 1); ++v) {
      for (int u = std::max(x - contract.radius, 0);
           u <= std::min(x + contract.radius, scores.width - 1); ++u) {
        const bool before = v < y || (v == y && u < x);
        if (at(u, v) > here || (before && at(u, v) == here)) return true;
      }
    }
    return false;
  };
  std::vector<Keypoint> found;
  for (int y = contract.border; y < scores.height - contract.border; ++y) {
    for (int x = contract.border; x < scores.width - contract.border; ++x) {
      if (!(at(x, y) >= contract.threshold) || beaten(x, y)) continue;
      Keypoint keypoint;
      keypoint.x = static_cast<float>(x);
      keypoint.y = static_cast<float>(y);
      keypoint.scale = 1;
      keypoint.response = at(x, y);
      found.push_back(keypoint);
    }
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Keypoint& a, const Keypoint& b) { return a.response > b.response; });
  return found;
}

std::unique_ptr<FeatureMethod> make_dense_method(const OnnxContract& contract, int max_features) {
  return std::make_unique<DenseMethod>(contract, max_features);
}

}  // namespace hybrid_slam
