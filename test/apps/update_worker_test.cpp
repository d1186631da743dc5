#include "apps/slam/update_worker.h"

#include <stdexcept>
#include <vector>

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
  const auto before = here.snapshot();
  Channel<int> told(1);
  UpdateWorker worker([&] { told.push(1); });
  for (int i = 0; i < 3; ++i) {
    here.optimize_local(newest);
    CHECK_FALSE(worker.is_done());
    worker.start(beside.begin_local({&newest, 1}));
    REQUIRE(told.pop());
    CHECK(worker.is_done());
    CHECK(beside.end_local(std::get<LocalUpdate>(worker.take())).variable_landmarks > 0);
  }
  CHECK_FALSE(worker.is_done());
  const auto pose = [](const MapSnapshot& map, KeyframeId id) {
    return map.at(id).cam_from_world.params;
  };
  for (const KeyframeId id : here.view().keyframe_ids()) {
    CHECK(pose(beside.view(), id) == pose(here.view(), id));
    CHECK((pose(here.view(), id) != pose(*before, id)) == (id != here.view().origin()));
  }
}

TEST_CASE("an update that nobody takes ends with its worker") {
  Backend backend = small_backend();
  const KeyframeId newest = backend.view().keyframe_ids().back();
  int told = 0;
  {
    UpdateWorker worker([&] { ++told; });
    worker.start(backend.begin_local({&newest, 1}));
  }
  CHECK(told <= 1);
  CHECK_THROWS_AS(backend.catch_up(), std::logic_error);  // the backend still waits for it
}

TEST_CASE("an update that fails is told at once and thrown where it is taken") {
  Backend backend = small_backend();
  Channel<int> told(1);
  UpdateWorker worker([&] { told.push(1); });
  worker.start(backend.begin_local(std::vector{KeyframeId(1000)}));  // no such keyframe
  REQUIRE(told.pop());
  CHECK(worker.is_done());
  CHECK_THROWS_AS(worker.take(), std::logic_error);
  CHECK(worker.is_done());
  CHECK_THROWS_AS(worker.take(), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
