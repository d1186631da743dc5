#include <algorithm>
#include <cmath>
#include <utility>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/feature_eval/methods/onnx_methods.h"
#include "apps/feature_eval/methods/onnx_network.h"

namespace hybrid_slam {
namespace {

// Halved as often as is asked for: pixel i of level l lies at pixel i * 2^l of the image.
class HalvedImages {
 public:
  explicit HalvedImages(const GrayImage& image) {
    const cv::Mat pixels(image.height, image.width, CV_8UC1,
                         const_cast<std::uint8_t*>(image.pixels.data()));
    pixels.convertTo(levels_.emplace_back(), CV_32F);
  }

  const cv::Mat& level(std::size_t wanted) {
    while (levels_.size() <= wanted) {
      cv::Mat half;
      cv::pyrDown(levels_.back(), half);
      levels_.push_back(half);
    }
    return levels_[wanted];
  }

 private:
  std::vector<cv::Mat> levels_;
};

cv::Mat cut(HalvedImages& images, const Keypoint& keypoint, const OnnxContract& contract) {
  const double side = contract.patch_scales * keypoint.scale;
  const double step = side / std::max(contract.width, contract.height);  // [px] between samples
  const double level = std::floor(std::log2(std::max(step, 1.0)));
  const double shrink = std::exp2(-level);
  const double c = shrink * step * std::cos(keypoint.angle);
  const double s = shrink * step * std::sin(keypoint.angle);
  const double middle_x = 0.5 * (contract.width - 1), middle_y = 0.5 * (contract.height - 1);
  const cv::Matx23d image_from_patch(c, -s, shrink * keypoint.x - c * middle_x + s * middle_y,  //
                                     s, c, shrink * keypoint.y - s * middle_x - c * middle_y);
  cv::Mat patch;
  cv::warpAffine(images.level(static_cast<std::size_t>(level)), patch, image_from_patch,
                 {contract.width, contract.height}, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REPLICATE);
  return patch;
}

void normalise(cv::Mat& patch, const OnnxContract& contract) {
  patch = (patch * contract.scale - contract.mean) / contract.deviation;
  if (!contract.per_patch) return;
  cv::Scalar mean, deviation;
  cv::meanStdDev(patch, mean, deviation);
  constexpr double kLeast = 1e-7;  // a patch of one grey stays all zero
  patch = (patch - mean[0]) / std::max(deviation[0], kLeast);
}

class PatchMethod final : public FeatureMethod {
 public:
  PatchMethod(const OnnxContract& contract, const SiftOptions& sift)
      : FeatureMethod(contract.ratio),
        contract_(contract),
        network_(contract.model),
        sift_(make_sift(sift)) {
    describe(cv::Mat(input_shape(), CV_32F, cv::Scalar(0)));
  }

  DescribedFeatures extract(const GrayImage& image, const GrayImage* mask,
                            StageTimes& times) override {
    StageClock whole(times), stage(times);
    DescribedFeatures features;
    features.keypoints = sift_->extract(image, mask).keypoints;
    stage.lap("detection");
    HalvedImages images(image);
    FloatDescriptors descriptors{contract_.length, {}};
    const std::size_t count = features.size();
    const auto batch = static_cast<std::size_t>(contract_.batch);
    for (std::size_t first = 0; first < count; first += batch) {
      const std::size_t end = std::min(count, first + batch);
      cv::Mat input(input_shape(), CV_32F, cv::Scalar(0));  // the last one is filled with zeros
      for (std::size_t i = first; i < end; ++i) {
        cv::Mat patch = cut(images, features.keypoints[i], contract_);
        normalise(patch, contract_);
        patch.copyTo(cv::Mat(contract_.height, contract_.width, CV_32F,
                             input.ptr<float>(static_cast<int>(i - first))));
      }
      const cv::Mat rows = describe(input);
      const auto numbers = static_cast<std::ptrdiff_t>(end - first) * contract_.length;
      descriptors.values.insert(descriptors.values.end(), rows.ptr<float>(),
                                rows.ptr<float>() + numbers);
    }
    for (std::size_t i = 0; i < count; ++i) {
      finish_descriptor(&descriptors.values[i * static_cast<std::size_t>(contract_.length)],
                        contract_);
    }
    features.descriptors = std::move(descriptors);
    stage.lap("descriptors");
    whole.lap(kTotal);
    return features;
  }

 private:
  std::vector<int> input_shape() const {
    return {contract_.batch, 1, contract_.height, contract_.width};
  }

  // A descriptor per patch, one after the other.
  cv::Mat describe(const cv::Mat& input) {
    const std::vector<cv::Mat> outputs = network_.run(input);
    const auto expected =
        static_cast<std::size_t>(contract_.batch) * static_cast<std::size_t>(contract_.length);
    for (const cv::Mat& output : outputs) {
      if (output.size[0] == contract_.batch && output.total() == expected) return output;
    }
    network_.refuse(
        input, outputs,
        "not " + std::to_string(contract_.batch) + "x" + std::to_string(contract_.length));
  }

  OnnxContract contract_;
  OnnxNetwork network_;
  std::unique_ptr<SiftExtractor> sift_;
};

}  // namespace

std::vector<float> cut_patch(const GrayImage& image, const Keypoint& keypoint,
                             const OnnxContract& contract) {
  HalvedImages images(image);
  const cv::Mat patch = cut(images, keypoint, contract);
  return {patch.begin<float>(), patch.end<float>()};
}

void finish_descriptor(float* values, const OnnxContract& contract) {
  if (!contract.unit) return;
  double squares = 0;
  for (int i = 0; i < contract.length; ++i) squares += static_cast<double>(values[i]) * values[i];
  const auto scale = static_cast<float>(squares > 0 ? 1 / std::sqrt(squares) : 0);
  for (int i = 0; i < contract.length; ++i) values[i] *= scale;
}

std::unique_ptr<FeatureMethod> make_patch_method(const OnnxContract& contract,
                                                 const SiftOptions& sift) {
  return std::make_unique<PatchMethod>(contract, sift);
}

std::unique_ptr<FeatureMethod> make_onnx_method(const OnnxContract& contract,
                                                const SiftOptions& sift) {
  return contract.kind == OnnxContract::Kind::kPatchDescriptor
             ? make_patch_method(contract, sift)
             : make_dense_method(contract, sift.max_features);
}

}  // namespace hybrid_slam
