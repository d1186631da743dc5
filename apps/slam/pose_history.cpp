#include "apps/slam/pose_history.h"

#include <algorithm>

namespace hybrid_slam {

void PoseHistory::add(const FrameResult& frame) {
  const std::lock_guard lock(mutex_);
  std::deque<Entry>& frames = frames_[frame.camera];
  if (!frames.empty() && frame.time <= frames.back().time) frames.clear();  // the clock was set
  const KeyframeId reference = frame.tracked.reference;
  frames.push_back(
      {frame.time, frame.index, frame.has_pose(), reference,
       reference.valid() ? frame.tracked.cam_from_reference : frame.tracked.cam_from_world,
       frame.tracked.cam_from_world});
  if (frames.size() > size_) frames.pop_front();
}

void PoseHistory::became_keyframe(const KeyframeResult& keyframe) {
  const std::lock_guard lock(mutex_);
  std::deque<Entry>& frames = frames_[keyframe.camera];
  const auto same = std::find_if(frames.rbegin(), frames.rend(),
                                 [&](const Entry& entry) { return entry.index == keyframe.index; });
  if (same == frames.rend()) return;
  same->reference = keyframe.id;
  same->cam_from_reference = Rigid3d();
}

void PoseHistory::clear() {
  const std::lock_guard lock(mutex_);
  frames_.clear();
}

std::vector<CorrectedPose> PoseHistory::corrected(const MapSnapshot& map) {
  const std::lock_guard lock(mutex_);
  std::vector<CorrectedPose> moved;
  for (auto& [camera, frames] : frames_) {
    for (Entry& entry : frames) {
      const auto now = pose(entry, map);
      if (!now || (now->translation() == entry.told.translation() &&
                   now->rotation().coeffs() == entry.told.rotation().coeffs())) {
        continue;
      }
      entry.told = *now;
      moved.push_back({camera, entry.time, *now});
    }
  }
  return moved;
}

std::optional<Rigid3d> PoseHistory::pose(const Entry& entry, const MapSnapshot& map) {
  if (!entry.has_pose) return std::nullopt;
  if (!entry.reference.valid()) return entry.cam_from_reference;
  return entry.cam_from_reference * map.cam_from_world(entry.reference);
}

std::optional<Rigid3d> PoseHistory::at(CameraKind camera, Nanoseconds time,
                                       const MapSnapshot& map) const {
  const std::lock_guard lock(mutex_);
  const auto of_camera = frames_.find(camera);
  if (of_camera == frames_.end()) return std::nullopt;
  const std::deque<Entry>& frames = of_camera->second;
  const auto after =
      std::lower_bound(frames.begin(), frames.end(), time,
                       [](const Entry& entry, Nanoseconds when) { return entry.time < when; });
  if (after == frames.end()) return std::nullopt;
  const auto b = pose(*after, map);
  if (after->time == time) return b;
  if (after == frames.begin()) return std::nullopt;
  const auto a = pose(*(after - 1), map);
  if (!a || !b) return std::nullopt;
  const double share = static_cast<double>(time - (after - 1)->time) /
                       static_cast<double>(after->time - (after - 1)->time);
  // Where the camera is, not where the world is seen from it, moves evenly.
  const Rigid3d from = inverse(*a);
  const Rigid3d to = inverse(*b);
  Rigid3d between;
  between.rotation() = from.rotation().slerp(share, to.rotation());
  between.translation() = (1 - share) * from.translation() + share * to.translation();
  return inverse(between);
}

}  // namespace hybrid_slam
