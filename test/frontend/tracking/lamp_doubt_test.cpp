#include "frontend/tracking/lamp_doubt.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <numbers>

#include "backend/map/map.h"
#include "cameras/camera.h"

namespace hybrid_slam {
namespace {

constexpr ShadingDoubt kDoubt{.of_vehicle = 0.01, .of_arm = 0.02};

// A map of two keyframes without points, a metre apart, and a frame that looks to the right.
struct TwoKeyframes {
  TwoKeyframes() {
    auto observations = std::make_shared<FrameObservations>();
    observations->camera =
        map.add_camera(Calibrated<RectifiedStereo>{{500, 500, 320, 240, 0.1}, 640, 480});
    origin = map.add_keyframe({observations, Rigid3d(), {}, {}, {}});
    observations = std::make_shared<FrameObservations>(*observations);
    observations->frame_index = 1;
    second = map.add_keyframe(
        {observations, Rigid3d(Eigen::Quaterniond::Identity(), {-1, 0, 0}), {}, {}, origin});
    const Eigen::Quaterniond right(
        Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitY()));
    frame.cam_from_world = Rigid3d(right, Eigen::Vector3d::Zero());
    frame.covariance_base = origin;
  }

  Matrix6d widened(LampDoubt& lamps, KeyframeId base) {
    frame.covariance.setZero();
    frame.covariance_base = base;
    lamps.widen(map.view(), kDoubt, frame);
    return frame.covariance;
  }

  Map map;
  KeyframeId origin, second;
  TrackedFrame frame;
};

TEST_CASE("A pose is doubted by a share of the vehicle's way, along it") {
  TwoKeyframes world;
  LampDoubt lamps(false);
  CHECK(world.widened(lamps, world.origin).isZero());  // nothing is known of where it is
  lamps.vehicle_at({3, 0, 0});
  Matrix6d expected = Matrix6d::Zero();
  expected(2, 2) = std::pow(0.01 * 3, 2);  // the world's x is ahead of the camera
  CHECK(world.widened(lamps, world.origin).isApprox(expected, 1e-12));
  expected(2, 2) = std::pow(0.01 * 2, 2);
  CHECK(world.widened(lamps, world.second).isApprox(expected, 1e-12));
  CHECK(world.widened(lamps, KeyframeId()).isZero());
}

TEST_CASE("With an arm its way counts as well, since it was first seen") {
  TwoKeyframes world;
  LampDoubt lamps(true);
  lamps.vehicle_at({3, 0, 0});
  lamps.arm_at({3, 5, 0});
  Matrix6d expected = Matrix6d::Zero();
  expected(2, 2) = std::pow(0.01 * 3, 2) / 3;
  CHECK(world.widened(lamps, world.origin).isApprox(expected, 1e-12));
  lamps.arm_at({3, 6, 0});
  expected(1, 1) = std::pow(0.02 * 1, 2) / 3;
  CHECK(world.widened(lamps, world.origin).isApprox(expected, 1e-12));
  expected(1, 1) = 0;  // as against another keyframe it is seen first
  expected(2, 2) = std::pow(0.01 * 2, 2) / 3;
  CHECK(world.widened(lamps, world.second).isApprox(expected, 1e-12));
}

}  // namespace
}  // namespace hybrid_slam
