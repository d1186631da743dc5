// Features without a landmark that keyframes lose, and all that names the others by their indices.
#include <algorithm>
#include <vector>

#include "backend/backend.h"
#include "test/support/synthetic_scene.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

SyntheticScene orbit() {
  SyntheticSceneOptions options;
  options.times = 14;
  options.step = 0.3;
  options.landmarks = 600;
  options.clutter = 40;
  options.missing_right_rate = 0.5;
  return make_synthetic_scene(options);
}

// A map that grows frame by frame, of what is known of the scene.
struct Grown {
  Grown(const SyntheticScene& scene, const BackendOptions& options)
      : scene(scene), backend(options), landmarks(scene.points_in_world.size()) {
    for (const Camera& camera : scene.cameras) backend.add_camera(camera);
  }

  void add(std::size_t i) {
    const SyntheticFrame& frame = scene.frames[i];
    const KeyframeId before = keyframes.empty() ? KeyframeId() : keyframes.back();
    NewKeyframe made{frame.observations, frame.cam_from_world, {}, {}, before};
    made.landmarks.resize(frame.landmark.size());
    Odometry odometry{before, {}, {}};
    odometry.motion.covariance = Vector6d::Constant(1e-4).asDiagonal();
    if (i > 0) {
      odometry.motion.b_from_a = frame.cam_from_world * inverse(scene.frames[i - 1].cam_from_world);
    }
    for (std::uint32_t k = 0; k < frame.landmark.size(); ++k) {
      if (k % 2 == 0) odometry.keypoints.push_back(k);
      if (frame.landmark[k] < 0) continue;
      const auto index = static_cast<std::size_t>(frame.landmark[k]);
      made.landmarks[k] = landmarks[index];
      if (landmarks[index].valid() || !frame.observations->has_right(k)) continue;
      made.new_points.emplace_back(k, scene.points_in_world[index]);
    }
    made.odometry = std::make_shared<const Odometry>(std::move(odometry));
    const KeyframeId id = backend.add(made);
    for (std::size_t k = 0; k < frame.landmark.size(); ++k) {
      const LandmarkId landmark = backend.view().at(id).landmarks[k];
      if (landmark.valid()) landmarks[static_cast<std::size_t>(frame.landmark[k])] = landmark;
    }
    keyframes.push_back(id);
  }

  const Keyframe& keyframe(std::size_t i) const { return backend.view().at(keyframes[i]); }

  const SyntheticScene& scene;
  Backend backend;
  std::vector<LandmarkId> landmarks;  // by landmark of the scene
  std::vector<KeyframeId> keyframes;
};

void check_same_estimate(const MapSnapshot& a, const MapSnapshot& b) {
  REQUIRE(a.keyframe_ids() == b.keyframe_ids());
  REQUIRE(a.landmark_ids() == b.landmark_ids());
  for (const KeyframeId id : a.keyframe_ids()) {
    REQUIRE(a.at(id).cam_from_world.params == b.at(id).cam_from_world.params);
  }
  for (const LandmarkId id : a.landmark_ids()) {
    REQUIRE(a.at(id).point_in_world == b.at(id).point_in_world);
    REQUIRE(a.at(id).descriptor == b.at(id).descriptor);
    REQUIRE(a.at(id).observations.size() == b.at(id).observations.size());
  }
}

// A keypoint with a landmark that comes behind one to be dropped.
std::uint32_t one_behind_a_gap(const Keyframe& keyframe) {
  const auto& ids = keyframe.landmarks;
  std::uint32_t i = 0;
  while (ids.at(i).valid() || keyframe.observations->has_right(i)) ++i;
  while (!ids.at(i).valid()) ++i;
  return i;
}

TEST_CASE("The estimate does not depend on features that were dropped, to the last bit") {
  const SyntheticScene scene = orbit();
  for (const int window : {0, 5}) {
    INFO("window " << window);
    BackendOptions options;
    options.incremental.solver.window = window;
    Grown whole(scene, options);
    Grown less(scene, options);
    for (std::size_t i = 0; i < scene.frames.size(); ++i) {
      for (Grown* grown : {&whole, &less}) {
        grown->add(i);
        grown->backend.optimize_local(grown->keyframes.back());
      }
      if (i >= 3) less.backend.drop_features({less.keyframes[i - 3], less.keyframes[i - 2]});
      check_same_estimate(whole.backend.view(), less.backend.view());
    }
    CHECK(less.keyframe(2).landmarks.size() + 15 <= whole.keyframe(2).landmarks.size());
    CHECK(less.backend.map().check_consistency() == std::vector<std::string>{});
    whole.backend.optimize_full();
    less.backend.optimize_full();
    check_same_estimate(whole.backend.view(), less.backend.view());
  }
}

TEST_CASE("Outliers of an earlier snapshot are found again, whatever was dropped since") {
  const SyntheticScene scene = orbit();
  const BackendOptions options;
  Grown grown(scene, options);
  for (std::size_t i = 0; i < 6; ++i) grown.add(i);
  const auto before = grown.backend.snapshot();
  const Keyframe& then = before->at(grown.keyframes[2]);
  const std::uint32_t keypoint = one_behind_a_gap(then);
  const LandmarkId outlier = then.landmarks[keypoint];
  const std::uint32_t last = static_cast<std::uint32_t>(then.landmarks.size() - 1);
  grown.backend.drop_features({then.id});
  const auto dropped = grown.backend.snapshot();
  BundleResult result;
  result.cam_from_world = {{then.id, then.cam_from_world}};
  result.outliers = {{outlier, {then.id, keypoint}},
                     {LandmarkId(1'000'000), {then.id, last}}};  // gone; an index beyond those now
  grown.backend.take_in_full(std::move(result), 0);
  const Keyframe& now = grown.keyframe(2);
  CHECK(std::count(now.landmarks.begin(), now.landmarks.end(), outlier) == 0);
  const auto seen = [](const MapSnapshot& map, KeyframeId id) {
    const auto& ids = map.at(id).landmarks;
    return std::count_if(ids.begin(), ids.end(), [](LandmarkId one) { return one.valid(); });
  };
  CHECK(seen(grown.backend.view(), then.id) == seen(*dropped, then.id) - 1);
  CHECK(grown.backend.map().check_consistency() == std::vector<std::string>{});
}

TEST_CASE("A loop gives observations to the keypoints that it was measured by, or none") {
  const SyntheticScene scene = orbit();
  for (const bool drop : {false, true}) {
    INFO("dropped " << drop);
    const BackendOptions options;
    Grown grown(scene, options);
    for (std::size_t i = 0; i < scene.frames.size(); ++i) grown.add(i);
    const Keyframe newest = grown.keyframe(scene.frames.size() - 1);
    // A landmark of the origin that the newest keyframe does not see, at a keypoint without one.
    const auto gap = std::find(newest.landmarks.begin(), newest.landmarks.end(), LandmarkId());
    const auto& there = grown.keyframe(0).landmarks;
    const auto unseen = std::find_if(there.begin(), there.end(), [&](LandmarkId id) {
      return id.valid() && std::count(newest.landmarks.begin(), newest.landmarks.end(), id) == 0;
    });
    REQUIRE((gap != newest.landmarks.end() && unseen != there.end()));
    LoopMeasurement loop;
    loop.keyframe = newest.id;
    loop.match = grown.keyframes[0];
    loop.keyframe_from_match = Sim3d(newest.cam_from_world);  // the origin's camera is the world
    loop.new_observations = {
        {*unseen, {newest.id, static_cast<std::uint32_t>(gap - newest.landmarks.begin())}}};
    loop.observations = newest.observations;
    const LandmarkId landmark = *unseen;
    if (drop) grown.backend.drop_features({newest.id});
    REQUIRE(grown.backend.close(loop).end == LoopEnd::kClosed);
    const auto& now = grown.backend.view().at(newest.id).landmarks;
    CHECK(std::count(now.begin(), now.end(), landmark) == (drop ? 0 : 1));
    CHECK(grown.backend.map().check_consistency() == std::vector<std::string>{});
  }
}

}  // namespace
}  // namespace hybrid_slam
