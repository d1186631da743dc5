#include "test/apps/scene_renderer/scene_matches.h"

#include <algorithm>

#include "frontend/features/sift.h"
#include "frontend/matching/brute_force.h"

namespace hybrid_slam {

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Camera left_camera(const SceneSequence& sequence) {
  const auto& stereo = sequence.cameras().stereo;
  const auto& [fx, fy, cx, cy, baseline] = stereo.params;
  return Calibrated<Pinhole>{{fx, fy, cx, cy}, stereo.width, stereo.height};
}

GrayImage gray(const ColorImage& image) {
  GrayImage result{image.width, image.height, {}};
  for (std::size_t i = 0; i < image.pixels.size(); i += 3) {
    const double grey =
        0.114 * image.pixels[i] + 0.587 * image.pixels[i + 1] + 0.299 * image.pixels[i + 2];
    result.pixels.push_back(static_cast<std::uint8_t>(grey + 0.5));
  }
  return result;
}

FeatureSet sift_of(const ColorImage& image, int features) {
  SiftOptions options;
  options.max_features = features;
  return make_sift(options)->extract(gray(image), nullptr);
}

std::vector<PixelMatch> match_sift(const FeatureSet& from, const FeatureSet& to, double ratio) {
  BruteForceOptions options;
  options.ratio = ratio;
  std::vector<PixelMatch> matches;
  for (const DescriptorMatch& match : match_brute_force(from, to, options)) {
    const Keypoint& a = from.keypoints[static_cast<std::size_t>(match.query)];
    const Keypoint& b = to.keypoints[static_cast<std::size_t>(match.train)];
    matches.push_back({{a.x, a.y}, {b.x, b.y}});
  }
  return matches;
}

double TruthErrors::median() const {
  std::vector<double> lengths;
  for (const Eigen::Vector2d& error : errors) lengths.push_back(error.norm());
  return hybrid_slam::median(lengths);
}

Eigen::Vector2d TruthErrors::median_offset() const {
  std::vector<double> x, y;
  for (const Eigen::Vector2d& error : errors) {
    x.push_back(error.x());
    y.push_back(error.y());
  }
  return {hybrid_slam::median(x), hybrid_slam::median(y)};
}

TruthErrors compare_with_truth(const std::vector<PixelMatch>& matches, const RayCaster& seafloor,
                               const Camera& from, const Rigid3d& world_from_from, const Camera& to,
                               const Rigid3d& world_from_to) {
  TruthErrors result;
  for (const PixelMatch& match : matches) {
    const Eigen::Vector3d ray = world_from_from.rotation() * *unproject(from, match.from);
    const Eigen::Vector3d eye = world_from_from.translation();
    const auto hit = seafloor.cast(eye.cast<float>(), ray.cast<float>());
    const auto place =
        hit ? project(to, inverse(world_from_to) * (eye + hit->distance * ray)) : std::nullopt;
    const Eigen::Vector2d error =
        place ? Eigen::Vector2d(match.to - *place) : Eigen::Vector2d(1e6, 1e6);
    if (error.norm() < 12) {
      result.errors.push_back(error);
    } else {
      ++result.gross;
    }
  }
  return result;
}

}  // namespace hybrid_slam
