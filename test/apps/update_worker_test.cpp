#include "apps/slam/update_worker.h"

#include <stdexcept>

#include "apps/slam/channel.h"
#include "backend/backend.h"
#include "test/support/filled_map.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

Backend small_backend() {
  SyntheticSceneOptions scene;
  scene.times = 6;
  scene.landmarks = 300;
  return Backend(BackendOptions(), std::move(fill_map(make_synthetic_scene(scene), {}).map));
}

TEST_CASE("an update that was run beside is what it would have been in the caller's thread") {
  Backend beside = small_backend();
  Backend here = small_backend();
  const KeyframeId newest = here.view().keyframe_ids().back();
  here.optimize_local(newest);
  Channel<int> told(1);
  UpdateWorker worker([&] { told.push(1); });
  CHECK_FALSE(worker.is_done());
  worker.start(beside.begin_local(newest));
  REQUIRE(told.pop());
  CHECK(worker.is_done());
  beside.end_local(worker.take());
  CHECK_FALSE(worker.is_done());
  for (const KeyframeId id : here.view().keyframe_ids()) {
    CHECK(beside.view().at(id).cam_from_world.params == here.view().at(id).cam_from_world.params);
  }
}

TEST_CASE("an update that fails is told at once and thrown where it is taken") {
  Backend backend = small_backend();
  Channel<int> told(1);
  UpdateWorker worker([&] { told.push(1); });
  worker.start(backend.begin_local(KeyframeId(1000)));  // no such keyframe
  REQUIRE(told.pop());
  CHECK(worker.is_done());
  CHECK_THROWS_AS(worker.take(), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
