#include "apps/feature_eval/methods/opencv_features.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>
#include <stdexcept>
#include <tuple>

#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#ifdef HS_WITH_SURF
#include <opencv2/xfeatures2d/nonfree.hpp>
#endif

#include "frontend/features/definition/parameters.h"

namespace hybrid_slam {
namespace {

constexpr float kSiftOffset = 0.25F;  // see opencv_sift.cpp

// Detection: with OpenCV's own thresholds a hazy image has a few hundred features.
constexpr int kFastThreshold = 5;           // ORB's, grey levels (OpenCV: 20)
constexpr int kBriskThreshold = 10;         // grey levels (OpenCV: 30)
constexpr float kHessianThreshold = 1e-4F;  // KAZE's and AKAZE's (OpenCV: 1e-3)
constexpr double kSurfThreshold = 20;       // (OpenCV: 100)

using Detector = cv::Ptr<cv::Feature2D>;

Detector make_cv_sift(int max_features) {
  // OpenCV compares |difference of Gaussians| / 255 * layers with its threshold.
  return cv::SIFT::create(max_features, sift::kLayers,
                          sift::kContrastThreshold * sift::kLayers / 255.0, sift::kEdgeThreshold,
                          sift::kInitialSigma);
}

Detector make_surf() {
#ifdef HS_WITH_SURF
  return cv::xfeatures2d::SURF::create(kSurfThreshold);
#else
  static_cast<void>(kSurfThreshold);
  throw std::logic_error("OpenCV without SURF");
#endif
}

using Makers = std::map<std::string, std::function<Detector(int)>>;

const Makers& makers() {
  static const Makers kMakers{
      {"cv_sift", make_cv_sift},
      {"cv_rootsift", make_cv_sift},
      {"orb",
       [](int max_features) {
         return cv::ORB::create(max_features, 1.2F, 8, 31, 0, 2, cv::ORB::HARRIS_SCORE, 31,
                                kFastThreshold);
       }},
      {"akaze",
       [](int) { return cv::AKAZE::create(cv::AKAZE::DESCRIPTOR_MLDB, 0, 3, kHessianThreshold); }},
      {"kaze", [](int) { return cv::KAZE::create(false, false, kHessianThreshold); }},
      {"brisk", [](int) { return cv::BRISK::create(kBriskThreshold); }},
      {"surf", [](int) { return make_surf(); }}};
  return kMakers;
}

Keypoint convert(const cv::KeyPoint& found, float offset) {
  Keypoint keypoint;
  keypoint.x = found.pt.x - offset;
  keypoint.y = found.pt.y - offset;
  keypoint.scale = found.size / 2;
  keypoint.angle = std::max(found.angle, 0.0F) * static_cast<float>(std::numbers::pi / 180);
  keypoint.response = found.response;
  return keypoint;
}

// The indices of the strongest.
std::vector<int> strongest(const std::vector<cv::KeyPoint>& found, int count) {
  std::vector<int> order(found.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
  const auto key = [&](int i) {
    const cv::KeyPoint& k = found[static_cast<std::size_t>(i)];
    return std::tuple(-k.response, k.pt.y, k.pt.x, k.size, k.angle, i);
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) { return key(a) < key(b); });
  order.resize(std::min(order.size(), static_cast<std::size_t>(count)));
  return order;
}

// Relja Arandjelovic's and Andrew Zisserman's RootSIFT (CVPR 2012), of non-negative numbers.
void take_root(float* values, int length) {
  float sum = 0;
  for (int i = 0; i < length; ++i) sum += values[i];
  for (int i = 0; i < length; ++i) values[i] = sum > 0 ? std::sqrt(values[i] / sum) : 0;
}

class OpenCvFeatures final : public FeatureMethod {
 public:
  OpenCvFeatures(const std::string& name, int max_features)
      : FeatureMethod(kMatchRatio),
        detector_(makers().at(name)(max_features)),
        max_features_(max_features),
        root_(name == "cv_rootsift"),
        offset_(root_ || name == "cv_sift" ? kSiftOffset : 0) {
    cv::setNumThreads(1);
  }

  DescribedFeatures extract(const GrayImage& image, const GrayImage* mask,
                            StageTimes& times) override {
    const auto pixels = [](const GrayImage& gray) {
      return cv::Mat(gray.height, gray.width, CV_8UC1,
                     const_cast<std::uint8_t*>(gray.pixels.data()));
    };
    StageClock clock(times);
    std::vector<cv::KeyPoint> found;
    cv::Mat rows;
    detector_->detectAndCompute(pixels(image), mask != nullptr ? pixels(*mask) : cv::Mat(), found,
                                rows);
    DescribedFeatures features = select(found, rows);
    clock.lap(kTotal);
    return features;
  }

 private:
  DescribedFeatures select(const std::vector<cv::KeyPoint>& found, const cv::Mat& rows) const {
    DescribedFeatures features;
    FloatDescriptors floats{detector_->descriptorSize(), {}};
    BitDescriptors bits{detector_->descriptorSize(), {}};
    const bool binary = detector_->descriptorType() == CV_8U;
    for (const int i : strongest(found, max_features_)) {
      features.keypoints.push_back(convert(found[static_cast<std::size_t>(i)], offset_));
      if (binary) {
        const auto* const row = rows.ptr<std::uint8_t>(i);
        bits.values.insert(bits.values.end(), row, row + bits.bytes);
      } else {
        const float* const row = rows.ptr<float>(i);
        floats.values.insert(floats.values.end(), row, row + floats.length);
        if (root_) take_root(&*(floats.values.end() - floats.length), floats.length);
      }
    }
    if (binary) {
      features.descriptors = std::move(bits);
    } else {
      features.descriptors = std::move(floats);
    }
    return features;
  }

  Detector detector_;
  int max_features_;
  bool root_;
  float offset_;
};

}  // namespace

const std::vector<std::string>& opencv_feature_names() {
  static const std::vector<std::string> kNames{"cv_sift", "cv_rootsift", "orb", "akaze",
                                               "kaze",    "brisk",       "surf"};
  return kNames;
}

std::string why_no_opencv_features(const std::string& name) {
  if (name != "surf") return {};
#ifdef HS_WITH_SURF
  try {
    make_surf();
    return {};
  } catch (const cv::Exception&) {
    return "OpenCV was built without its non-free features";
  }
#else
  return "OpenCV was built without xfeatures2d, which has it";
#endif
}

std::unique_ptr<FeatureMethod> make_opencv_features(const std::string& name, int max_features) {
  if (!makers().contains(name)) throw std::logic_error("no OpenCV features of this name: " + name);
  return std::make_unique<OpenCvFeatures>(name, max_features);
}

}  // namespace hybrid_slam
