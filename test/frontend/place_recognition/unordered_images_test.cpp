// Real seafloor images without any order: nearly every place that words propose is another one.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <random>
#include <string>

#include <catch2/catch.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "backend/map/map.h"
#include "frontend/features/sift.h"
#include "frontend/matching/brute_force.h"
#include "frontend/place_recognition/default_vocabulary.h"
#include "frontend/place_recognition/loop_finder.h"

namespace hybrid_slam {
namespace {

constexpr int kWidth = 400, kHeight = 300;
constexpr float kDisparity = 20;  // everything is equally far: 1.5 m, by the camera below

std::vector<std::string> shuffled_images(const std::string& folder) {
  std::vector<std::string> images;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".jpg") images.push_back(entry.path().string());
  }
  std::sort(images.begin(), images.end());
  std::mt19937 engine(1);
  for (std::size_t i = images.size(); i > 1; --i) std::swap(images[i - 1], images[engine() % i]);
  return images;
}

// The map that a stereo pair would make of single views of a plane, each a place of its own: two
// keyframes an image, so that each has a neighbour that can confirm what it sees.
class PlaneMap {
 public:
  PlaneMap() {
    map_.add_camera(Calibrated<RectifiedStereo>{
        {300, 300, (kWidth - 1) / 2.0, (kHeight - 1) / 2.0, 0.1}, kWidth, kHeight});
  }

  KeyframeId add(const FeatureSet& features) {
    auto observations = std::make_shared<FrameObservations>();
    observations->camera = CameraId(0);
    observations->features = features;
    NewKeyframe made{nullptr, Rigid3d(), {}, {}, newest_};
    for (std::uint32_t k = 0; k < features.size(); ++k) {
      const Keypoint& keypoint = features.keypoints[k];
      observations->u_right.push_back(keypoint.x - kDisparity);
      const auto point = triangulate_stereo(map_.view().camera(CameraId(0)),
                                            {keypoint.x, keypoint.y, keypoint.x - kDisparity});
      made.new_points.emplace_back(k, *point);
    }
    for (int copy = 0; copy < 2; ++copy) {
      auto seen = std::make_shared<FrameObservations>(*observations);
      seen->frame_index = frames_++;
      made.observations = std::move(seen);
      newest_ = map_.add_keyframe(made);
      made.new_points.clear();
      made.landmarks = map_.view().at(newest_).landmarks;
      made.reference = newest_;
    }
    return newest_;
  }

  const MapSnapshot& view() const { return map_.view(); }

 private:
  Map map_;
  KeyframeId newest_;
  std::int64_t frames_ = 0;
};

FeatureSet features_of(SiftExtractor& sift, const std::string& path) {
  const cv::Mat mat = cv::imread(path, cv::IMREAD_GRAYSCALE);
  GrayImage image{mat.cols, mat.rows, {}};
  image.pixels.assign(mat.datastart, mat.dataend);
  return sift.extract(image, nullptr);
}

// An oracle without words, nodes and our geometry: how many of brute force's mutual matches one
// homography explains.
int matches_of_one_plane(const FeatureSet& a, const FeatureSet& b) {
  BruteForceOptions options;
  options.ratio = 0.8;
  std::vector<cv::Point2f> in_a, in_b;
  for (const DescriptorMatch& match : match_brute_force(a, b, options)) {
    const Keypoint& p = a.keypoints[static_cast<std::size_t>(match.query)];
    const Keypoint& q = b.keypoints[static_cast<std::size_t>(match.train)];
    in_a.emplace_back(p.x, p.y);
    in_b.emplace_back(q.x, q.y);
  }
  if (in_a.size() < 8) return 0;
  cv::Mat inliers;
  cv::setRNGSeed(1);
  cv::findHomography(in_a, in_b, cv::RANSAC, 4, inliers, 2000, 0.999);
  return inliers.empty() ? 0 : cv::countNonZero(inliers);
}

TEST_CASE("Of a thousand unordered seafloor images none is taken for another", "[slow]") {
  const char* const data = std::getenv("HYBRID_SLAM_DATA");
  if (data == nullptr || !std::filesystem::is_directory(std::string(data) + "/underwater_images")) {
    std::cout << "SKIPPED: HYBRID_SLAM_DATA has no underwater_images\n";
    return;
  }
  const std::vector<std::string> images = shuffled_images(std::string(data) + "/underwater_images");
  REQUIRE(images.size() > 500);
  SiftOptions sift_options;
  sift_options.max_features = 1000;
  const auto sift = make_sift(sift_options);
  PlaneMap map;
  LoopFinder finder(std::make_shared<KeyframeDatabase>(default_vocabulary()), {});
  std::vector<FeatureSet> all;
  int proposed = 0, accepted = 0, wrong = 0;
  for (const std::string& path : images) {
    all.push_back(features_of(*sift, path));
    const KeyframeId id = map.add(all.back());
    for (const LoopProposal& proposal : finder.find(map.view(), id)) {
      ++proposed;
      if (!proposal.verification.loop) continue;
      ++accepted;
      const std::size_t other = proposal.match.value / 2;
      const int explained = matches_of_one_plane(all.back(), all[other]);
      const bool is_wrong = explained < 30;
      wrong += is_wrong ? 1 : 0;
      if (is_wrong) std::cout << "false: " << path << ' ' << images[other] << '\n';
      INFO(path << ' ' << images[other] << ": one plane explains " << explained);
      CHECK(!is_wrong);
    }
  }
  std::cout << images.size() << " images: " << proposed << " places proposed, " << accepted
            << " accepted, " << wrong << " of them false\n";
  CHECK(proposed > 200);
}

}  // namespace
}  // namespace hybrid_slam
