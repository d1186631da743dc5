#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>

#include <catch2/catch.hpp>

#include "apps/io/trajectory.h"
#include "apps/pipeline/slam_run.h"

namespace hybrid_slam {
namespace {

struct Outcome {
  FrameCounts frames;
  AbsoluteError error;  // SE3 alignment
};

// Runs the first `limit` frames (0: all) of a sequence with truth; none without the shared data.
std::optional<Outcome> run_sequence(const std::string& dataset, const std::string& name,
                                    std::size_t limit) {
  const char* data = std::getenv("HYBRID_SLAM_DATA");
  if (data == nullptr) {
    std::puts("SKIPPED: HYBRID_SLAM_DATA is not set");
    return std::nullopt;
  }
  const auto sequence =
      open_sequence(std::string(data) + "/" + dataset, SequenceLayout::kAuto, name);
  SlamOptions options;
  options.distribute();
  RunOptions run;
  run.threads = 2;
  run.limit = limit;
  const RunResult result = run_every_frame(ImageFrameSource(*sequence, options), options, run, {});
  Trajectory estimate;
  for (const FrameRecord& record : result.records) {
    if (record.frame.tracked()) {
      estimate.push_back({record.frame.time, inverse(result.cam_from_world(record))});
    }
  }
  const auto error =
      absolute_error(associate(estimate, sequence->info().truth, 0.02), TrajectoryAlignment::kSe3);
  REQUIRE(error);
  return Outcome{result.frames, *error};
}

}  // namespace

TEST_CASE("KITTI s1 is tracked within 6 cm and half a percent of its 60 m", "[integration]") {
  const auto outcome = run_sequence("kitti", "s1", 0);
  if (outcome) {
    CHECK(outcome->frames.tracked == 51);
    CHECK(outcome->error.position.rmse < 0.06);
    CHECK(*outcome->error.length_ratio() == Approx(1).margin(0.005));
  }
}

TEST_CASE("A rendered mound is tracked within less than a millimetre", "[integration]") {
  const auto outcome = run_sequence("uwsynth/hybrid", "H1", 40);
  if (outcome) {
    CHECK(outcome->frames.tracked == 40);
    CHECK(outcome->error.position.rmse < 0.0004);
  }
}

}  // namespace hybrid_slam
