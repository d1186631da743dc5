#include "frontend/mapping/redundancy.h"

#include <algorithm>

namespace hybrid_slam {
namespace {

constexpr double kSameScale = 1.26;  // a third of an octave: SIFT's step between scales

}  // namespace

std::string RedundancyOptions::validate() const {
  if (!(share > 0 && share <= 1)) return "redundant_share must lie in (0, 1]";
  if (observers < 1) return "redundant_observers must be positive";
  return {};
}

double normalized_scale(const Camera& camera, const Keypoint& keypoint) {
  return double{keypoint.scale} / focal_length(camera);
}

bool is_well_seen(const MapSnapshot& map, const Landmark& landmark, double scale, int observers,
                  const std::vector<KeyframeId>& left_out) {
  int seen = 0;
  for (const Observation& observation : landmark.observations) {
    if (std::find(left_out.begin(), left_out.end(), observation.keyframe) != left_out.end()) {
      continue;
    }
    const Keyframe& keyframe = map.at(observation.keyframe);
    const Keypoint& there = keyframe.observations->features.keypoints[observation.keypoint];
    if (normalized_scale(map.camera(keyframe), there) <= kSameScale * scale &&
        ++seen >= observers) {
      return true;
    }
  }
  return false;
}

bool is_redundant(const MapSnapshot& map, std::span<const LandmarkInView> landmarks, int others,
                  const RedundancyOptions& options, const std::vector<KeyframeId>& left_out) {
  const auto total = static_cast<int>(landmarks.size());
  const double enough = options.share * (total + others);
  int well_seen = 0;
  for (int i = 0; i < total && well_seen + (total - i) > enough; ++i) {
    const auto& [landmark, scale] = landmarks[static_cast<std::size_t>(i)];
    well_seen += is_well_seen(map, *landmark, scale, options.observers, left_out) ? 1 : 0;
    if (well_seen > enough) return true;
  }
  return false;
}

}  // namespace hybrid_slam
