#include "frontend/tracking/stereo_keyframe.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "backend/map/map.h"
#include "frontend/tracking/last_frame.h"

namespace hybrid_slam {
namespace {

constexpr double kFocal = 400;
constexpr double kBaseline = 0.1;

Camera camera() {
  return Calibrated<RectifiedStereo>{{kFocal, kFocal, 319.5, 239.5, 0.1}, 640, 480};
}

// A frame with one keypoint at each depth [m]; 0: without a right match. Odd ones have landmarks.
Frame frame_with(const std::vector<double>& depths) {
  StereoFeatures features;
  features.left.kind = DescriptorKind::kSynthetic;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    Keypoint keypoint;
    keypoint.x = 400;
    keypoint.y = static_cast<float>(100 + i);
    features.left.keypoints.push_back(keypoint);
    features.left.descriptors.emplace_back();
    features.u_right.push_back(
        depths[i] > 0 ? static_cast<float>(400 - kFocal * kBaseline / depths[i]) : kNoRightMatch);
  }
  Frame frame = make_frame(17, 1.7, features, 640, 480);
  for (std::uint32_t i = 1; i < depths.size(); i += 2) frame.landmarks[i] = LandmarkId(i);
  frame.cam_from_world =
      Rigid3d(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized())),
              {1, -2, 3});
  return frame;
}

std::vector<std::uint32_t> new_keypoints(const NewKeyframe& keyframe) {
  std::vector<std::uint32_t> indices;
  for (const auto& [index, point] : keyframe.new_points) indices.push_back(index);
  return indices;
}

}  // namespace

TEST_CASE("Close keypoints are counted with and without landmarks, depths give their median") {
  const Frame frame = frame_with({2, 2.5, 0, 0, 3.9, 4.1, 1, 8, 9});
  const auto coverage = stereo_coverage(camera(), frame, 4);
  REQUIRE(coverage);
  CHECK(coverage->close_tracked == 1);    // 2.5 m
  CHECK(coverage->close_untracked == 3);  // 2 m, 3.9 m, 1 m
  CHECK(coverage->median_depth == Approx(3.9).epsilon(1e-4));
  LeftOutKeypoints left_out(9);
  left_out[0] = left_out[1] = left_out[7] = true;  // 2 m, 2.5 m, 8 m
  const auto without = stereo_coverage(camera(), frame, 4, left_out);
  REQUIRE(without);
  CHECK(without->close_tracked == 0);
  CHECK(without->close_untracked == 2);
  CHECK(without->median_depth == Approx(4.1).epsilon(1e-4));
  CHECK_FALSE(stereo_coverage(camera(), frame_with({0, 0}), 4));
  CHECK_FALSE(stereo_coverage(camera(), frame_with({}), 4));
}

TEST_CASE("A keyframe makes a new point of every close keypoint without a landmark") {
  const Frame frame = frame_with({2, 2.5, 0, 0, 3.9, 4.1, 1, 8, 9, 3, 4.5});
  const NewKeyframe keyframe =
      make_stereo_keyframe(CameraId(2), camera(), frame, KeyframeId(5), 4, 0);
  CHECK(new_keypoints(keyframe) == std::vector<std::uint32_t>{6, 0, 4});  // nearest first
  CHECK(keyframe.reference == KeyframeId(5));
  CHECK(keyframe.landmarks == frame.landmarks);
  CHECK(keyframe.cam_from_world.params == frame.cam_from_world.params);
  CHECK(keyframe.observations->camera == CameraId(2));
  CHECK(keyframe.observations->frame_index == 17);
  CHECK(keyframe.observations->time == 1.7);
  CHECK(keyframe.observations->size() == frame.size());
  CHECK(keyframe.observations->has_right(0));
  CHECK_FALSE(keyframe.observations->has_right(2));
  for (const auto& [index, point_in_world] : keyframe.new_points) {
    const Eigen::Vector3d point = frame.cam_from_world * point_in_world;
    const Keypoint& keypoint = frame.features.left.keypoints[index];
    CHECK(kFocal * point.x() / point.z() + 319.5 == Approx(keypoint.x));
    CHECK(kFocal * point.y() / point.z() + 239.5 == Approx(keypoint.y));
    CHECK(kFocal * (point.x() - kBaseline) / point.z() + 319.5 ==
          Approx(frame.features.u_right[index]));
  }
}

TEST_CASE("Where few points are close, the nearest of the others make new points, too") {
  const Frame frame = frame_with({2, 2.5, 0, 0, 3.9, 4.1, 1, 8, 9, 3, 4.5});
  const auto made = [&](int min_new_points) {
    return new_keypoints(
        make_stereo_keyframe(CameraId(0), camera(), frame, KeyframeId(), 4, min_new_points));
  };
  CHECK(made(3) == std::vector<std::uint32_t>{6, 0, 4});
  CHECK(made(4) == std::vector<std::uint32_t>{6, 0, 4, 10});
  CHECK(made(100) == std::vector<std::uint32_t>{6, 0, 4, 10, 8});
}

TEST_CASE("What is left out of a keyframe is no keypoint of it, unless it is a landmark already") {
  const Frame frame = frame_with({2, 2.5, 0, 0, 3.9, 4.1, 1, 8, 9, 3, 3.5});
  LeftOutKeypoints left_out(11);
  left_out[1] = left_out[2] = left_out[4] = true;  // a landmark, none, a new point
  NewKeyframe keyframe =
      make_stereo_keyframe(CameraId(2), camera(), frame, KeyframeId(5), 4, 0, left_out);
  CHECK(new_keypoints(keyframe) == std::vector<std::uint32_t>{6, 0, 10});
  const auto points = keyframe.new_points;
  Odometry odometry;
  odometry.keypoints = {2, 4, 5, 10};
  keyframe.odometry = std::make_shared<const Odometry>(odometry);
  leave_out(left_out, keyframe);
  // 0, 1, 3, 5, 6, 7, 8, 9 and 10 stay.
  REQUIRE(keyframe.observations->size() == 9);
  CHECK(keyframe.observations->u_right.size() == 9);
  CHECK(keyframe.observations->features.keypoints[2].y == 103);
  CHECK(keyframe.observations->dropped == 2);
  CHECK(keyframe.landmarks == std::vector{LandmarkId(), LandmarkId(1), LandmarkId(3), LandmarkId(5),
                                          LandmarkId(), LandmarkId(7), LandmarkId(), LandmarkId(9),
                                          LandmarkId()});
  CHECK(new_keypoints(keyframe) == std::vector<std::uint32_t>{4, 0, 8});
  CHECK(keyframe.new_points[2].second == points[2].second);
  CHECK(keyframe.odometry->keypoints == std::vector<std::uint32_t>{3, 8});
  CHECK(keyframe.odometry->followed() == 4);

  // The frame that became this keyframe gets its landmarks, each at its own keypoint.
  LastFrame last(CameraId(2));
  TrackedFrame tracked;
  tracked.source = PoseSource::kInitialization;
  Map map;
  for (int i = 0; i < 3; ++i) map.add_camera(camera());
  keyframe.landmarks.assign(9, LandmarkId());
  keyframe.reference = KeyframeId();
  keyframe.odometry = nullptr;
  tracked.keyframe = keyframe;
  Frame without_landmarks = frame;
  without_landmarks.landmarks.assign(11, LandmarkId());
  last.remember(without_landmarks, tracked);
  const Keyframe& added = map.view().at(map.add_keyframe(keyframe));
  last.follow(map.view());
  std::vector<LandmarkId> expected(11);
  expected[0] = added.landmarks[0];
  expected[6] = added.landmarks[4];
  expected[10] = added.landmarks[8];
  REQUIRE(expected[10].valid());
  CHECK(last.frame().landmarks == expected);
}

TEST_CASE("Landmarks that others have seen, too, are well-founded; in a young map all are") {
  Map map;
  map.add_camera(camera());
  const auto add = [&](std::int64_t index, const std::vector<LandmarkId>& tracked, bool births) {
    auto observations = std::make_shared<FrameObservations>();
    const Frame frame = frame_with({2, 2, 2, 2});
    observations->camera = CameraId(0);
    observations->frame_index = index;
    observations->features = frame.features.left;
    observations->u_right = frame.features.u_right;
    NewKeyframe keyframe{observations, Rigid3d(), tracked, {}, map.view().origin()};
    for (std::uint32_t i = 0; births && i < 4; ++i) keyframe.new_points.push_back({i, {0, 0, 2}});
    return map.add_keyframe(keyframe);
  };
  const KeyframeId first = add(0, std::vector<LandmarkId>(4), true);
  const auto& born = map.view().at(first).landmarks;
  CHECK(count_well_founded(map.view(), first) == 4);
  const KeyframeId second = add(1, {born[0], born[1], born[2], LandmarkId()}, false);
  CHECK(count_well_founded(map.view(), first) == 4);
  const KeyframeId third = add(2, {born[0], LandmarkId(), LandmarkId(), LandmarkId()}, false);
  CHECK(count_well_founded(map.view(), first) == 3);  // the fourth is its own alone
  CHECK(count_well_founded(map.view(), second) == 3);
  CHECK(count_well_founded(map.view(), third) == 1);
  MapEdit edit;
  edit.erased_keyframes = {second};
  map.apply(edit);
  CHECK(count_well_founded(map.view(), second) == 0);
}

}  // namespace hybrid_slam
