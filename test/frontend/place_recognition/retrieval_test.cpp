// Real images, none of which the default vocabulary has seen, found again by changed copies of
// them.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>

#include <catch2/catch.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "frontend/features/sift.h"
#include "frontend/place_recognition/default_vocabulary.h"
#include "frontend/place_recognition/guided_matching.h"
#include "frontend/place_recognition/inverted_index.h"

namespace hybrid_slam {
namespace {

constexpr int kImages = 60;

std::vector<std::string> images_below(const std::string& folder, int count) {
  std::vector<std::string> all, some;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    const std::string extension = entry.path().extension().string();
    if (extension == ".jpg" || extension == ".png") all.push_back(entry.path().string());
  }
  std::sort(all.begin(), all.end());
  const std::size_t step = std::max<std::size_t>(1, all.size() / static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < all.size(); i += step) some.push_back(all[i]);
  return some;
}

FeatureSet features_of_image(SiftExtractor& sift, const cv::Mat& mat) {
  GrayImage image{mat.cols, mat.rows, {}};
  for (int y = 0; y < mat.rows; ++y) {
    image.pixels.insert(image.pixels.end(), mat.ptr(y), mat.ptr(y) + mat.cols);
  }
  return sift.extract(image, nullptr);
}

cv::Mat load(const std::string& path) {
  const cv::Mat full = cv::imread(path, cv::IMREAD_GRAYSCALE);
  cv::Mat small;
  const double scale = std::min(1.0, 640.0 / std::max(full.cols, full.rows));
  cv::resize(full, small, {}, scale, scale, cv::INTER_AREA);
  return small;
}

// Turned, tilted, smaller, of less contrast, with noise.
cv::Mat changed(const cv::Mat& image, std::uint64_t seed) {
  const auto width = static_cast<float>(image.cols), height = static_cast<float>(image.rows);
  const std::vector<cv::Point2f> from{{0, 0}, {width, 0}, {width, height}, {0, height}};
  const std::vector<cv::Point2f> to{{0.05F * width, 0.15F * height},
                                    {0.8F * width, 0},
                                    {0.95F * width, 0.75F * height},
                                    {0.15F * width, 0.9F * height}};
  cv::Mat result;
  cv::warpPerspective(image, result, cv::getPerspectiveTransform(from, to), image.size(),
                      cv::INTER_LINEAR);
  cv::Mat noise(result.size(), CV_32F);
  cv::RNG(seed).fill(noise, cv::RNG::NORMAL, 0, 4);
  result.convertTo(result, CV_32F, 0.7, 40);
  result += noise;
  result.convertTo(result, CV_8U);
  return result;
}

TEST_CASE("The default vocabulary is small and has the shape that it should have") {
  const Vocabulary vocabulary = default_vocabulary();
  CHECK(vocabulary.kind() == DescriptorKind::kRootSift);
  CHECK(vocabulary.depth() == 4);
  CHECK(vocabulary.guide_level() == 2);
  CHECK(vocabulary.words() > 9000);
  CHECK(vocabulary.words() <= 10000);
  const auto& weights = vocabulary.tables().weights;
  CHECK(*std::max_element(weights.begin(), weights.end()) > 3);
}

TEST_CASE("Changed copies of real images are found among all of them", "[slow]") {
  const char* data = std::getenv("HYBRID_SLAM_DATA");
  if (data == nullptr) {
    std::cout << "SKIPPED: HYBRID_SLAM_DATA is not set\n";
    return;
  }
  const auto sift = make_sift({.max_features = 1000});
  const Vocabulary vocabulary = default_vocabulary();
  InvertedIndex index;
  std::vector<cv::Mat> images;
  for (const std::string& path : images_below(std::string(data) + "/underwater_images", kImages)) {
    const auto id = static_cast<std::uint32_t>(images.size());
    images.push_back(load(path));
    index.add(KeyframeId(id), find_words(vocabulary, features_of_image(*sift, images[id])).bow);
  }
  int first = 0, among_three = 0;
  double guided = 0, all = 0;
  for (std::uint32_t i = 0; i < images.size(); ++i) {
    const FeatureSet original = features_of_image(*sift, images[i]);
    const FeatureSet copy = features_of_image(*sift, changed(images[i], i));
    const ImageWords words = find_words(vocabulary, copy);
    const auto hits = index.query(words.bow, {});
    const auto hit = std::find_if(hits.begin(), hits.end(), [&](const SimilarKeyframe& h) {
      return h.keyframe == KeyframeId(i);
    });
    first += hit == hits.begin() ? 1 : 0;
    among_three += hit - hits.begin() < 3 ? 1 : 0;
    const BruteForceOptions options{.ratio = 0.8};
    const DirectIndex original_index = find_words(vocabulary, original).index;
    guided += static_cast<double>(
        match_guided(copy, words.index, original, original_index, options).size());
    all += static_cast<double>(match_brute_force(copy, original, options).size());
  }
  const auto count = static_cast<double>(images.size());
  std::cout << "found first " << first << ", among three " << among_three << " of " << count
            << "; guided matches " << guided / all << " of all\n";
  CHECK(first > 0.95 * count);
  CHECK(among_three > 0.97 * count);
  CHECK(guided > 0.6 * all);
}

}  // namespace
}  // namespace hybrid_slam
