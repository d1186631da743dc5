#include "frontend/tracking/stereo_keyframe.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "backend/map/dropped_features.h"
#include "backend/map/frame_observations.h"

namespace hybrid_slam {
namespace {

// From the stereo match; none without one, or where it is left out.
std::optional<Eigen::Vector3d> point_in_cam(const Camera& camera, const Frame& frame,
                                            std::size_t keypoint,
                                            const LeftOutKeypoints& left_out) {
  if (!left_out.empty() && left_out[keypoint]) return std::nullopt;
  const Keypoint& left = frame.features.left.keypoints[keypoint];
  return triangulate_stereo(camera, {left.x, left.y, frame.features.u_right[keypoint]});
}

bool in_view(const Camera& camera, const Frame& frame, const Eigen::Vector3d& point_in_cam) {
  const auto pixel = project(camera, point_in_cam);
  return pixel && pixel->x() >= 0 && pixel->y() >= 0 && pixel->x() <= frame.width - 1 &&
         pixel->y() <= frame.height - 1;
}

template <typename Visit>
void for_each_well_founded(const MapSnapshot& map, KeyframeId id, const Visit& visit) {
  const Keyframe* keyframe = map.find(id);
  if (keyframe == nullptr) return;
  const std::size_t min_observations = map.keyframe_count() <= 2 ? 1 : 2;
  for (const LandmarkId landmark : keyframe->landmarks) {
    const Landmark* found = landmark.valid() ? map.find(landmark) : nullptr;
    if (found != nullptr && found->observations.size() >= min_observations) visit(*found);
  }
}

}  // namespace

std::optional<StereoCoverage> stereo_coverage(const Camera& camera, const Frame& frame,
                                              double close_depth,
                                              const LeftOutKeypoints& left_out) {
  StereoCoverage coverage;
  std::vector<double> depths;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const auto point = point_in_cam(camera, frame, i, left_out);
    if (!point) {
      continue;
    }
    depths.push_back(point->z());
    if (point->z() < close_depth) {
      ++(frame.landmarks[i].valid() ? coverage.close_tracked : coverage.close_untracked);
    }
  }
  if (depths.empty()) {
    return std::nullopt;
  }
  const auto middle = depths.begin() + static_cast<long>(depths.size() / 2);
  std::nth_element(depths.begin(), middle, depths.end());
  coverage.median_depth = *middle;
  return coverage;
}

int count_well_founded(const MapSnapshot& map, KeyframeId id) {
  int count = 0;
  for_each_well_founded(map, id, [&](const Landmark&) { ++count; });
  return count;
}

ReferenceOverlap reference_overlap(const MapSnapshot& map, KeyframeId reference,
                                   const Camera& camera, const Frame& frame,
                                   const LeftOutKeypoints& left_out) {
  ReferenceOverlap overlap;
  for_each_well_founded(map, reference, [&](const Landmark& landmark) {
    ++overlap.landmarks;
    overlap.in_view +=
        in_view(camera, frame, frame.cam_from_world * landmark.point_in_world) ? 1 : 0;
  });
  const Rigid3d reference_from_frame =
      map.cam_from_world(reference) * inverse(frame.cam_from_world);
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const auto point = point_in_cam(camera, frame, i, left_out);
    if (!point) continue;
    ++overlap.points;
    overlap.new_points +=
        !frame.landmarks[i].valid() && !in_view(camera, frame, reference_from_frame * *point) ? 1
                                                                                              : 0;
  }
  return overlap;
}

NewKeyframe make_stereo_keyframe(CameraId camera_id, const Camera& camera, const Frame& frame,
                                 KeyframeId reference, double close_depth, int min_new_points,
                                 const LeftOutKeypoints& left_out) {
  struct Candidate {
    std::uint32_t index;
    Eigen::Vector3d point;  // in the camera
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const auto point = point_in_cam(camera, frame, i, left_out);
    if (point && !frame.landmarks[i].valid()) {
      candidates.push_back({static_cast<std::uint32_t>(i), *point});
    }
  }
  std::stable_sort(
      candidates.begin(), candidates.end(),
      [](const Candidate& a, const Candidate& b) { return a.point.z() < b.point.z(); });
  NewKeyframe keyframe{
      make_observations(camera_id, frame), frame.cam_from_world, frame.landmarks, {}, reference};
  const Rigid3d world_from_cam = inverse(frame.cam_from_world);
  for (const Candidate& candidate : candidates) {
    if (candidate.point.z() > close_depth &&
        static_cast<int>(keyframe.new_points.size()) >= min_new_points) {
      break;
    }
    keyframe.new_points.emplace_back(candidate.index, world_from_cam * candidate.point);
  }
  return keyframe;
}

void leave_out(const LeftOutKeypoints& left_out, NewKeyframe& keyframe) {
  std::vector<std::uint32_t> kept;
  for (std::uint32_t i = 0; i < left_out.size(); ++i) {
    if (!left_out[i] || keyframe.landmarks[i].valid()) kept.push_back(i);
  }
  if (kept.size() < left_out.size()) keep_features(keyframe, kept);
}

}  // namespace hybrid_slam
