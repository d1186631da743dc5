#include "frontend/matching/projection_matcher.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "backend/map/prefetch.h"
#include "frontend/matching/descriptor_distance.h"

namespace hybrid_slam {
namespace {

constexpr double kFinestScale = 1.6;  // [px]: below it the window grows no smaller

template <typename Calibration>
std::optional<LandmarkPrediction> predict(const Calibration& camera, double focal,
                                          const Rigid3d& cam_from_world,
                                          const Eigen::Vector3d& camera_in_world,
                                          const Landmark& landmark, double min_view_cosine) {
  using Model = typename Calibration::Model;
  const Eigen::Vector3d point_in_cam = cam_from_world * landmark.point_in_world;
  Eigen::Vector3d measurement(0, 0, std::numeric_limits<double>::quiet_NaN());
  if (!Model::template project<double>(camera.params.data(), point_in_cam.data(),
                                       measurement.data())) {
    return std::nullopt;
  }
  if (measurement.x() < 0 || measurement.y() < 0 || measurement.x() > camera.width - 1 ||
      measurement.y() > camera.height - 1) {
    return std::nullopt;
  }
  const Eigen::Vector3d ray = landmark.point_in_world - camera_in_world;
  const double distance = ray.norm();
  const double view_cosine = ray.dot(landmark.mean_direction) / distance;
  if (view_cosine < min_view_cosine) {
    return std::nullopt;
  }
  return LandmarkPrediction{landmark.id, measurement.head<2>(), measurement.z(),
                            focal * landmark.object_scale / distance, view_cosine};
}

struct Best {
  int keypoint = -1;
  int distance = std::numeric_limits<int>::max();
  int second_distance = std::numeric_limits<int>::max();
};

bool is_candidate(const FeatureView& view, const LandmarkPrediction& prediction, int index,
                  double radius, double max_scale_ratio) {
  const Keypoint& keypoint = view.features.keypoints[static_cast<std::size_t>(index)];
  const double ratio = keypoint.scale / prediction.scale;
  if (ratio > max_scale_ratio || ratio * max_scale_ratio < 1) {
    return false;
  }
  if (view.u_right.empty() || std::isnan(prediction.u_right)) {
    return true;
  }
  const float u_right = view.u_right[static_cast<std::size_t>(index)];
  return std::isnan(u_right) || std::abs(u_right - prediction.u_right) <= radius;
}

Best search(const FeatureView& view, const LandmarkPrediction& prediction,
            const Descriptor& descriptor, const std::vector<char>* taken,
            const ProjectionMatcherOptions& options, std::vector<int>& candidates) {
  const double growth = std::max(1.0, prediction.scale / kFinestScale);
  const double radius =
      std::max(options.radius, std::min(options.radius * growth, options.max_scaled_radius));
  candidates.clear();
  view.grid.query(prediction.pixel.x(), prediction.pixel.y(), radius, &candidates);
  Best best;
  for (const int index : candidates) {
    if ((taken != nullptr && (*taken)[static_cast<std::size_t>(index)] != 0) ||
        !is_candidate(view, prediction, index, radius, options.max_scale_ratio)) {
      continue;
    }
    const int distance =
        squared_distance(descriptor, view.features.descriptors[static_cast<std::size_t>(index)]);
    if (distance < best.distance) {
      best = {index, distance, best.distance};
    } else {
      best.second_distance = std::min(best.second_distance, distance);
    }
  }
  return best;
}

}  // namespace

std::string ProjectionMatcherOptions::validate() const {
  if (!(radius > 0) || !(max_scaled_radius > 0)) {
    return "matcher: radius and max_scaled_radius must be positive";
  }
  if (!(max_descriptor_distance > 0)) return "matcher: max_descriptor_distance must be positive";
  if (!(ratio > 0 && ratio <= 1)) return "matcher: ratio must lie in (0, 1]";
  if (!(max_scale_ratio >= 1)) return "matcher: max_scale_ratio must not be below 1";
  if (!(max_view_angle_deg > 0 && max_view_angle_deg <= 180)) {
    return "matcher: max_view_angle_deg must lie in (0, 180]";
  }
  return {};
}

std::vector<LandmarkPrediction> predict_landmarks(const MapSnapshot& map, const Camera& camera,
                                                  const Rigid3d& cam_from_world,
                                                  std::span<const LandmarkId> ids,
                                                  double max_view_angle_deg) {
  const double min_view_cosine = std::cos(max_view_angle_deg * std::numbers::pi / 180);
  const double focal = focal_length(camera);
  const Eigen::Vector3d camera_in_world = origin_in_a(cam_from_world);
  std::vector<LandmarkPrediction> predictions;
  predictions.reserve(ids.size());
  std::visit(
      [&](const auto& calibrated) {
        for (std::size_t i = 0; i < ids.size(); ++i) {
          if (i + kPrefetchAhead < ids.size()) prefetch(map.find(ids[i + kPrefetchAhead]));
          const Landmark* landmark = map.find(ids[i]);
          if (landmark == nullptr) {
            continue;
          }
          const auto prediction = predict(calibrated, focal, cam_from_world, camera_in_world,
                                          *landmark, min_view_cosine);
          if (prediction) {
            predictions.push_back(*prediction);
          }
        }
      },
      camera);
  return predictions;
}

std::vector<ProjectionMatch> match_predictions(const MapSnapshot& map, const FeatureView& view,
                                               std::span<const LandmarkPrediction> predictions,
                                               const std::vector<char>* taken,
                                               const ProjectionMatcherOptions& options) {
  const int max_distance = to_squared_bytes(options.max_descriptor_distance);
  std::vector<ProjectionMatch> of_keypoint(view.features.size());
  std::vector<int> candidates;
  for (const LandmarkPrediction& prediction : predictions) {
    const Best best =
        search(view, prediction, map.at(prediction.id).descriptor, taken, options, candidates);
    if (best.keypoint < 0 || best.distance > max_distance ||
        best.distance > options.ratio * options.ratio * best.second_distance) {
      continue;
    }
    ProjectionMatch& match = of_keypoint[static_cast<std::size_t>(best.keypoint)];
    if (!match.landmark.valid() || best.distance < match.descriptor_distance) {
      match = {prediction.id, best.keypoint, static_cast<double>(best.distance)};
    }
  }
  std::erase_if(of_keypoint, [](const ProjectionMatch& match) { return !match.landmark.valid(); });
  for (ProjectionMatch& match : of_keypoint) {
    match.descriptor_distance =
        from_squared_bytes(static_cast<std::int32_t>(match.descriptor_distance));
  }
  return of_keypoint;
}

double accidental_match_rate(const MapSnapshot& map, const FeatureView& view,
                             std::span<const LandmarkPrediction> predictions,
                             const ProjectionMatcherOptions& options) {
  constexpr std::size_t kPairs = 256;
  constexpr std::size_t kStride = 7919;  // a prime: neighbours in the lists are no pairs
  const int max_distance = to_squared_bytes(options.max_descriptor_distance);
  const std::size_t keypoints = view.features.size();
  if (predictions.empty() || keypoints == 0) return 1;
  int passed = 1;
  for (std::size_t k = 0; k < kPairs; ++k) {
    const LandmarkId id = predictions[k * predictions.size() / kPairs].id;
    const Descriptor& other = view.features.descriptors[(k + 1) * kStride % keypoints];
    passed += squared_distance(map.at(id).descriptor, other) <= max_distance ? 1 : 0;
  }
  return static_cast<double>(passed) / (kPairs + 1);
}

}  // namespace hybrid_slam
