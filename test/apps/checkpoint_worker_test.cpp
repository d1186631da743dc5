#include "apps/slam/checkpoint_worker.h"

#include <stdexcept>

#include <catch2/catch.hpp>

#include "backend/map/map.h"

namespace hybrid_slam {
namespace {

// A snapshot that can be told from others: with so many cameras.
std::shared_ptr<const MapSnapshot> map_of(std::size_t cameras) {
  Map map;
  for (std::size_t i = 0; i < cameras; ++i) map.add_camera(Calibrated<Pinhole>{});
  return map.snapshot();
}

TEST_CASE("Of the maps that come while one is saved, the last one follows", "[pipeline]") {
  Channel<std::size_t> begun(10);
  Channel<std::string> answers(10);
  Channel<SessionFailure> failures(10);
  CheckpointWorker worker(
      [&](const MapSnapshot& map) {
        begun.push(map.camera_count());
        return answers.pop().value_or("");
      },
      2, [&](const SessionFailure& failure) { failures.push(failure); });
  for (std::size_t i = 1; i <= 2; ++i) worker.keyframe_added(map_of(i));
  CHECK(begun.pop() == 2U);
  for (std::size_t i = 3; i <= 9; ++i) worker.keyframe_added(map_of(i));  // waits for nobody
  answers.push("disk full");
  CHECK(begun.pop() == 8U);
  const auto failure = failures.pop();
  CHECK(failure->text == "disk full");
  CHECK_FALSE(failure->internal);
  answers.push("");
  worker.finish();
  CHECK(begun.size() == 0);
  CHECK(failures.size() == 0);
  REQUIRE(worker.times().stages().size() == 1);
  CHECK(worker.times().stages()[0].second.count() == 2);
}

TEST_CASE("Without an interval nothing is saved", "[pipeline]") {
  int failures = 0;
  CheckpointWorker worker([](const MapSnapshot&) { return "saved"; }, 0,
                          [&](const SessionFailure&) { ++failures; });
  for (std::size_t i = 0; i < 10; ++i) worker.keyframe_added(map_of(i));
  worker.finish();
  CHECK(failures == 0);
}

TEST_CASE("What saving throws is told at once, as a bug of ours, and saving goes on",
          "[pipeline]") {
  Channel<std::size_t> begun(1);
  Channel<SessionFailure> failures(10);
  CheckpointWorker worker(
      [&](const MapSnapshot& map) -> std::string {
        begun.push(map.camera_count());
        if (map.camera_count() == 1) throw std::logic_error("a bug");
        return {};
      },
      1, [&](const SessionFailure& failure) { failures.push(failure); });
  worker.keyframe_added(map_of(1));
  CHECK(begun.pop() == 1U);
  const auto failure = failures.pop();  // before finish()
  CHECK(failure->text == "internal error while saving a checkpoint: a bug");
  CHECK(failure->internal);
  worker.keyframe_added(map_of(2));
  CHECK(begun.pop() == 2U);
  worker.finish();
  CHECK(failures.size() == 0);
}

TEST_CASE("Every so many keyframes a checkpoint is due", "[pipeline]") {
  CheckpointSchedule every_third(3);
  CheckpointSchedule never(0);
  for (int keyframe = 1; keyframe <= 10; ++keyframe) {
    CHECK(every_third.due() == (keyframe % 3 == 0));
    CHECK_FALSE(never.due());
  }
}

}  // namespace
}  // namespace hybrid_slam
