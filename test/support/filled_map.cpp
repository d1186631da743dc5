#include "test/support/filled_map.h"

#include <utility>

#include "cameras/geometry/se3.h"
#include "test/support/random.h"

namespace hybrid_slam {

namespace {

class MapFiller {
 public:
  MapFiller(const SyntheticScene& scene, const FillOptions& options)
      : scene_(scene), options_(options), random_(options.seed) {
    filled_.landmarks.resize(scene.points_in_world.size());
    waiting_.resize(scene.points_in_world.size());
    for (const auto& point : scene.points_in_world) {
      initial_.push_back(point + random_.gaussian3(options.point_noise));
    }
    for (const Camera& camera : scene.cameras) filled_.map.add_camera(camera);
  }

  FilledMap fill() {
    for (std::size_t f = 0; f < scene_.frames.size(); f += options_.stride) {
      if (f >= options_.split && filled_.first_landmarks.empty()) begin_anew();
      add_frame(f);
    }
    return std::move(filled_);
  }

 private:
  struct Unborn {
    std::size_t landmark;
    std::uint32_t keypoint;
  };

  void begin_anew() {
    filled_.first_landmarks = filled_.landmarks;
    filled_.landmarks.assign(filled_.landmarks.size(), LandmarkId());
    waiting_.assign(waiting_.size(), Observation());
    for (Eigen::Vector3d& point : initial_) point = options_.split_drift * point;
  }

  Rigid3d misplaced(const Rigid3d& cam_from_world) const {
    return without_scale(Sim3d(cam_from_world) * inverse(options_.split_drift));
  }

  void add_frame(std::size_t index) {
    const SyntheticFrame& frame = scene_.frames[index];
    NewKeyframe made;
    made.observations = frame.observations;
    made.cam_from_world = frame.cam_from_world;
    if (!filled_.keyframes.empty()) {
      Vector6d noise;
      noise.head<3>() = random_.gaussian3(options_.translation_noise);
      noise.tail<3>() = random_.gaussian3(options_.rotation_noise);
      made.cam_from_world = se3_exp(noise) * frame.cam_from_world;
      made.reference = filled_.keyframes.back();
    }
    if (index >= options_.split) made.cam_from_world = misplaced(made.cam_from_world);
    made.landmarks.resize(frame.landmark.size());
    std::vector<Unborn> unborn;
    for (std::uint32_t k = 0; k < frame.landmark.size(); ++k) {
      if (frame.landmark[k] < 0) continue;
      const auto landmark = static_cast<std::size_t>(frame.landmark[k]);
      made.landmarks[k] = filled_.landmarks[landmark];
      if (!filled_.landmarks[landmark].valid()) unborn.push_back({landmark, k});
    }
    if (options_.odometry && !filled_.keyframes.empty()) made.odometry = odometry_to(frame);
    const KeyframeId id = filled_.map.add_keyframe(made);
    filled_.frames.push_back(index);
    filled_.keyframes.push_back(id);
    give_birth(*frame.observations, id, unborn);
  }

  // From the keyframe of the same camera before it.
  std::shared_ptr<const Odometry> odometry_to(const SyntheticFrame& frame) const {
    for (std::size_t i = filled_.keyframes.size(); i-- > 0;) {
      const SyntheticFrame& before = scene_.frames[filled_.frames[i]];
      if (before.observations->camera != frame.observations->camera) continue;
      Odometry made{filled_.keyframes[i],
                    {frame.cam_from_world * inverse(before.cam_from_world),
                     Vector6d::Constant(1e-5).asDiagonal()},
                    {}};
      for (std::uint32_t k = 0; k < frame.landmark.size(); ++k) made.keypoints.push_back(k);
      return std::make_shared<const Odometry>(std::move(made));
    }
    return nullptr;
  }

  void give_birth(const FrameObservations& frame, KeyframeId id,
                  const std::vector<Unborn>& unborn) {
    MapEdit births;
    for (const Unborn& u : unborn) {
      Observation& earlier = waiting_[u.landmark];
      const Observation observation{id, u.keypoint};
      if (earlier.keyframe.valid()) {
        births.new_landmarks.push_back({initial_[u.landmark], {earlier, observation}});
      } else if (frame.has_right(u.keypoint)) {
        births.new_landmarks.push_back({initial_[u.landmark], {observation}});
      } else {
        earlier = observation;
      }
    }
    filled_.map.apply(births);
    const auto& landmarks = filled_.map.view().at(id).landmarks;
    for (const Unborn& u : unborn) filled_.landmarks[u.landmark] = landmarks[u.keypoint];
  }

  const SyntheticScene& scene_;
  const FillOptions& options_;
  Random random_;
  FilledMap filled_;
  std::vector<Eigen::Vector3d> initial_;
  std::vector<Observation> waiting_;  // the one observation of a landmark that needs another
};

}  // namespace

FilledMap fill_map(const SyntheticScene& scene, const FillOptions& options) {
  return MapFiller(scene, options).fill();
}

void move_world(Map& map, const Rigid3d& new_from_old) {
  std::vector<std::pair<KeyframeId, Rigid3d>> poses;
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> points;
  for (const KeyframeId id : map.view().keyframe_ids()) {
    poses.emplace_back(id, map.view().at(id).cam_from_world * inverse(new_from_old));
  }
  for (const LandmarkId id : map.view().landmark_ids()) {
    points.emplace_back(id, new_from_old * map.view().at(id).point_in_world);
  }
  map.move(poses, points);
}

}  // namespace hybrid_slam
