#include "apps/pipeline/checkpoint_worker.h"

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
  CheckpointWorker worker(
      [&](const MapSnapshot& map) {
        begun.push(map.camera_count());
        return answers.pop().value_or("");
      },
      2);
  for (std::size_t i = 1; i <= 2; ++i) worker.keyframe_added(map_of(i));
  CHECK(begun.pop() == 2U);
  for (std::size_t i = 3; i <= 9; ++i) worker.keyframe_added(map_of(i));  // waits for nobody
  answers.push("disk full");
  CHECK(begun.pop() == 8U);
  const auto failures = worker.take_failures();
  REQUIRE(failures.size() == 1);
  CHECK(failures[0].text == "disk full");
  CHECK_FALSE(failures[0].internal);
  CHECK(worker.take_failures().empty());
  answers.push("");
  worker.finish();
  CHECK(begun.size() == 0);
  CHECK(worker.take_failures().empty());
  REQUIRE(worker.times().stages().size() == 1);
  CHECK(worker.times().stages()[0].second.size() == 2);
}

TEST_CASE("Without an interval nothing is saved", "[pipeline]") {
  CheckpointWorker worker([](const MapSnapshot&) { return "saved"; }, 0);
  for (std::size_t i = 0; i < 10; ++i) worker.keyframe_added(map_of(i));
  worker.finish();
  CHECK(worker.take_failures().empty());
}

TEST_CASE("What saving throws is told at once, as a bug of ours, and saving goes on",
          "[pipeline]") {
  Channel<std::size_t> begun(1);
  CheckpointWorker worker(
      [&](const MapSnapshot& map) -> std::string {
        begun.push(map.camera_count());
        if (map.camera_count() == 1) throw std::logic_error("a bug");
        return {};
      },
      1);
  worker.keyframe_added(map_of(1));
  CHECK(begun.pop() == 1U);
  std::vector<RunFailure> failures;
  while (failures.empty()) failures = worker.take_failures();  // before finish()
  CHECK(failures[0].text == "internal error while saving a checkpoint: a bug");
  CHECK(failures[0].internal);
  worker.keyframe_added(map_of(2));
  CHECK(begun.pop() == 2U);
  worker.finish();
  CHECK(worker.take_failures().empty());
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
