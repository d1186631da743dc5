#include "test/backend/same_map.h"

#include <cstring>

#include <catch2/catch.hpp>

namespace hybrid_slam {

namespace {

// Bit by bit: NaN, which marks a missing right match, equals itself.
template <typename T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

bool same_frame(const FrameObservations& a, const FrameObservations& b) {
  return a.camera == b.camera && a.frame_index == b.frame_index && a.time == b.time &&
         a.features.kind == b.features.kind &&
         same_bits(a.features.keypoints, b.features.keypoints) &&
         same_bits(a.features.descriptors, b.features.descriptors) &&
         same_bits(a.u_right, b.u_right) && a.dropped == b.dropped;
}

bool same_odometry(const Odometry* a, const Odometry* b) {
  if (a == nullptr || b == nullptr) return a == b;
  return a->previous == b->previous && a->motion.b_from_a.params == b->motion.b_from_a.params &&
         a->motion.covariance == b->motion.covariance && a->keypoints == b->keypoints &&
         a->dropped == b->dropped;
}

bool same_keyframe(const Keyframe& a, const Keyframe& b) {
  return a.id == b.id && same_frame(*a.observations, *b.observations) &&
         a.cam_from_world.params == b.cam_from_world.params && a.landmarks == b.landmarks &&
         a.covisible == b.covisible && a.parent == b.parent && a.children == b.children &&
         a.keep == b.keep && same_odometry(a.odometry.get(), b.odometry.get());
}

bool same_landmark(const Landmark& a, const Landmark& b) {
  return a.id == b.id && a.point_in_world == b.point_in_world && a.observations == b.observations &&
         a.reference == b.reference && a.descriptor == b.descriptor &&
         a.mean_direction == b.mean_direction && a.object_scale == b.object_scale &&
         a.visible == b.visible && a.found == b.found;
}

bool same_camera(const Camera& a, const Camera& b) {
  return a.index() == b.index() && image_width(a) == image_width(b) &&
         image_height(a) == image_height(b) &&
         std::visit(
             [&](const auto& c) {
               return c.params == std::get<std::decay_t<decltype(c)>>(b).params;
             },
             a);
}

}  // namespace

void check_same_map(const MapSnapshot& a, const MapSnapshot& b) {
  REQUIRE(a.camera_count() == b.camera_count());
  for (std::uint32_t i = 0; i < a.camera_count(); ++i) {
    CHECK(same_camera(a.camera(CameraId(i)), b.camera(CameraId(i))));
    CHECK(a.correction(CameraId(i)) == b.correction(CameraId(i)));
    CHECK(a.newest_frame_index(CameraId(i)) == b.newest_frame_index(CameraId(i)));
  }
  CHECK(a.origin() == b.origin());
  REQUIRE(a.keyframe_ids() == b.keyframe_ids());
  REQUIRE(a.landmark_ids() == b.landmark_ids());
  for (const KeyframeId id : a.keyframe_ids()) {
    INFO("keyframe " << id.value);
    CHECK(same_keyframe(a.at(id), b.at(id)));
  }
  for (const LandmarkId id : a.landmark_ids()) {
    INFO("landmark " << id.value);
    CHECK(same_landmark(a.at(id), b.at(id)));
  }
}

}  // namespace hybrid_slam
