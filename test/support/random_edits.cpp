#include "test/support/random_edits.h"

#include <algorithm>

#include "cameras/geometry/se3.h"

namespace hybrid_slam {

void RandomEdits::step() {
  MapEdit edit;
  switch (random_.below(with_poses_ ? 9 : 6)) {
    case 0:
      for (int i = 0; i < 3; ++i) edit.merged.push_back({landmark(), landmark()});
      break;
    case 1:
    case 2:
      for (int i = 0; i < 20; ++i) edit.new_observations.push_back({landmark(), observation()});
      break;
    case 3:
      for (int i = 0; i < 10; ++i) {
        edit.new_landmarks.push_back({random_.gaussian3(2), {observation(), observation()}});
      }
      break;
    case 4:
      for (int i = 0; i < 5; ++i) edit.erased_observations.push_back(existing());
      edit.erased_observations.push_back({landmark(), observation()});
      break;
    case 5:
      edit.erased_landmarks.push_back(landmark());
      edit.counted.push_back({landmark(), 1, 0});
      edit.counted.push_back({landmark(), 0, 1});
      break;
    case 6:
      if (random_.below(20) == 0) edit.erased_keyframes.push_back(keyframe());
      if (random_.below(40) == 0) filled_.map.drop_features(keyframe());
      break;
    case 7:
      if (random_.below(20) == 0) add_keyframe();
      break;
    default:
      move();
  }
  filled_.map.apply(edit);
}

KeyframeId RandomEdits::keyframe() {
  return filled_.keyframes[random_.below(filled_.keyframes.size())];
}
LandmarkId RandomEdits::landmark() {
  return LandmarkId(static_cast<std::uint32_t>(random_.below(1500)));
}

Observation RandomEdits::observation() {
  const KeyframeId id = keyframe();
  const Keyframe* found = filled_.map.view().find(id);
  const std::size_t keypoints = found == nullptr ? 1 : found->landmarks.size();
  if (keypoints == 0) return observation();  // all were dropped
  return {id, static_cast<std::uint32_t>(random_.below(keypoints))};
}

LandmarkObservation RandomEdits::existing() {
  const Landmark* found = filled_.map.view().find(landmark());
  if (found == nullptr) return {landmark(), observation()};
  return {found->id, found->observations[random_.below(found->observations.size())]};
}

void RandomEdits::add_keyframe() {
  const Keyframe* like = filled_.map.view().find(keyframe());
  if (like == nullptr || like->landmarks.size() < 3) return;
  NewKeyframe made{like->observations, like->cam_from_world, like->landmarks, {}, keyframe()};
  for (LandmarkId& id : made.landmarks) {
    if (random_.below(3) == 0) id = landmark();
  }
  Odometry odometry{random_.below(2) == 0 ? keyframe() : newest_like(*like),
                    {random_.rigid(1, 1), Vector6d::Constant(1e-4).asDiagonal()},
                    {0, 2}};
  made.odometry = std::make_shared<const Odometry>(std::move(odometry));
  filled_.keyframes.push_back(filled_.map.add_keyframe(made));
}

// The newest living keyframe of the same camera.
KeyframeId RandomEdits::newest_like(const Keyframe& keyframe) const {
  const std::vector<KeyframeId> ids = filled_.map.view().keyframe_ids();
  const auto same = std::find_if(ids.rbegin(), ids.rend(), [&](KeyframeId id) {
    return filled_.map.view().at(id).observations->camera == keyframe.observations->camera;
  });
  return same != ids.rend() ? *same : KeyframeId();
}

void RandomEdits::move() {
  const KeyframeId id = keyframe();
  const Rigid3d pose = filled_.map.view().cam_from_world(id);
  const Rigid3d motion = se3_exp(random_.vector(6, 0.01));
  filled_.map.move({{id, motion * pose}}, {{landmark(), random_.gaussian3(3)}});
}

}  // namespace hybrid_slam
