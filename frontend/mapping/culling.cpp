#include "frontend/mapping/culling.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

namespace hybrid_slam {
namespace {

constexpr int kNeighbours = 15;  // landmarks in common, as fusion and the search for loops count

int weighted_observations(const MapSnapshot& map, const Landmark& landmark) {
  int count = 0;
  for (const Observation& observation : landmark.observations) {
    const auto& observations = *map.at(observation.keyframe).observations;
    count += observations.has_right(observation.keypoint) ? 2 : 1;
  }
  return count;
}

bool is_redundant(const MapSnapshot& map, const Keyframe& keyframe,
                  const std::vector<KeyframeId>& erased, const CullingOptions& options) {
  const double stereo_baseline = baseline(map.camera(keyframe));
  const double max_depth = stereo_baseline > 0 ? options.close_baselines * stereo_baseline
                                               : std::numeric_limits<double>::infinity();
  std::vector<KeyframeId> left_out = erased;
  left_out.push_back(keyframe.id);
  std::vector<LandmarkInView> in_view;
  for (std::size_t i = 0; i < keyframe.landmarks.size(); ++i) {
    const Landmark* landmark =
        keyframe.landmarks[i].valid() ? map.find(keyframe.landmarks[i]) : nullptr;
    if (landmark == nullptr ||
        (keyframe.cam_from_world * landmark->point_in_world).norm() > max_depth) {
      continue;
    }
    const Keypoint& keypoint = keyframe.observations->features.keypoints[i];
    in_view.push_back({landmark, normalized_scale(map.camera(keyframe), keypoint)});
  }
  return is_redundant(map, in_view, 0, options.redundancy, left_out);
}

// Of its camera: tracking refers to it, and the odometry of the next one will begin there.
bool is_newest(const MapSnapshot& map, const Keyframe& keyframe) {
  const CameraId camera = keyframe.observations->camera;
  const Keyframe* newest = map.find_frame(camera, map.newest_frame_index(camera));
  return newest != nullptr && newest->id == keyframe.id;
}

}  // namespace

std::string CullingOptions::validate() const {
  if (!(min_found_ratio >= 0 && min_found_ratio <= 1)) {
    return "culling: min_found_ratio must lie in [0, 1]";
  }
  if (const std::string error = redundancy.validate(); !error.empty()) return "culling: " + error;
  if (min_observations < 1 || probation < 1) {
    return "culling: min_observations and probation must be positive";
  }
  if (!(close_baselines > 0)) return "culling: close_baselines must be positive";
  if (full_keyframes < 0) return "culling: full_keyframes must not be negative";
  return {};
}

void LandmarkProbation::admit(const MapSnapshot& map, KeyframeId keyframe) {
  const Keyframe* found = keyframe.valid() ? map.find(keyframe) : nullptr;
  if (found == nullptr) {
    return;
  }
  LandmarkId newest = newest_known_;
  for (const LandmarkId id : found->landmarks) {
    if (id.valid() && (!newest_known_.valid() || id > newest_known_)) {
      recent_.push_back({id, keyframe == previous_ ? 0 : -1});
      newest = newest.valid() ? std::max(newest, id) : id;
    }
  }
  newest_known_ = newest;
}

MapEdit LandmarkProbation::cull(const MapSnapshot& map, KeyframeId newest) {
  admit(map, previous_);  // those that mapping made after the previous call
  admit(map, newest);
  previous_ = newest;
  MapEdit edit;
  std::erase_if(recent_, [&](Recent& recent) {
    const Landmark* landmark = map.find(recent.id);
    if (landmark == nullptr) {
      return true;
    }
    ++recent.keyframes;
    const bool unseen = landmark->found < options_.min_found_ratio * landmark->visible;
    const bool weak = recent.keyframes >= options_.probation &&
                      weighted_observations(map, *landmark) < options_.min_observations;
    if (unseen || weak) {
      edit.erased_landmarks.push_back(recent.id);
    }
    return unseen || weak || recent.keyframes > options_.probation;
  });
  return edit;
}

MapEdit LandmarkProbation::conclude(const MapSnapshot& map) {
  admit(map, previous_);
  MapEdit edit;
  for (const Recent& recent : recent_) {
    const Landmark* landmark = map.find(recent.id);
    if (landmark == nullptr) continue;
    if (landmark->found - 1 < options_.min_found_ratio * (landmark->visible - 1)) {
      edit.erased_landmarks.push_back(recent.id);
    }
  }
  recent_.clear();
  return edit;
}

std::vector<KeyframeId> KeyframeUse::gone_out(const MapSnapshot& map) {
  if (options_.full_keyframes == 0) return {};
  std::vector<KeyframeId> now;
  int newest = 0;
  for (std::uint32_t id = map.next_keyframe_id().value; id > 0 && newest < options_.full_keyframes;
       --id) {
    const Keyframe* keyframe = map.find(KeyframeId(id - 1));
    if (keyframe == nullptr) continue;
    ++newest;
    now.push_back(keyframe->id);
    for (const Covisible& covisible : keyframe->covisible) {
      if (covisible.shared_landmarks >= kNeighbours) now.push_back(covisible.id);
    }
  }
  std::sort(now.begin(), now.end());
  now.erase(std::unique(now.begin(), now.end()), now.end());
  std::vector<KeyframeId> gone;
  std::set_difference(in_use_.begin(), in_use_.end(), now.begin(), now.end(),
                      std::back_inserter(gone));
  in_use_ = std::move(now);
  return gone;
}

MapEdit cull_keyframes(const MapSnapshot& map, KeyframeId keyframe, const CullingOptions& options) {
  MapEdit edit;
  for (const Covisible& covisible : map.at(keyframe).covisible) {
    const Keyframe& candidate = map.at(covisible.id);
    if (candidate.id != map.origin() && !candidate.keep && !is_newest(map, candidate) &&
        is_redundant(map, candidate, edit.erased_keyframes, options)) {
      edit.erased_keyframes.push_back(candidate.id);
    }
  }
  return edit;
}

}  // namespace hybrid_slam
