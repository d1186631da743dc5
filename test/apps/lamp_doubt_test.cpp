// What a session tells of a pose includes what lamps may pretend that move along.
#include <catch2/catch.hpp>
#include <cmath>
#include <optional>

#include "apps/slam/session.h"
#include "test/apps/small_recording.h"

namespace hybrid_slam {
namespace {

// The last frame of a vehicle that went along x.
TrackedFrame last_frame(const SmallRecording& images, bool lamps_move) {
  TrackedFrame last;
  SessionObservers observers;
  observers.frame = [&](const FrameResult& frame) { last = frame.tracked; };
  SlamOptions slam;
  slam.features = 400;
  slam.tracking.refinement.shading.enabled = lamps_move;
  slam.distribute();
  SessionOptions options;
  options.mode = SessionMode::kEveryFrame;
  Session session({images.cameras.stereo, std::nullopt}, slam, options, observers);
  for (const SmallRecording::Moment& moment : images.moments) session.push(moment.stereo);
  session.finish();
  return last;
}

TEST_CASE("A session doubts poses by a share of the way of the vehicle's lamps", "[slam]") {
  const SmallRecording images = make_small_recording(12);
  const TrackedFrame still = last_frame(images, false);
  const TrackedFrame moving = last_frame(images, true);
  REQUIRE(still.tracked());
  REQUIRE(moving.tracked());
  const Rigid3d way = inverse(images.world_from_left.front()) * images.world_from_left.back();
  const Eigen::Vector3d off = moving.cam_from_world.rotation() * way.translation();
  const Matrix6d doubt = moving.covariance - still.covariance;
  CHECK(doubt.bottomRows<3>().norm() < 1e-3 * doubt.norm());  // of the position alone
  const double share = std::sqrt(doubt.trace()) / off.norm();
  CHECK(share > 1e-4);
  CHECK(share < 0.02);
  const Eigen::Vector3d along = off.normalized();
  CHECK(along.dot(doubt.topLeftCorner<3, 3>() * along) > 0.98 * doubt.trace());
}

}  // namespace
}  // namespace hybrid_slam
