#include <csignal>
#include <thread>

#include <catch2/catch.hpp>

#include "apps/slam/slam_options.h"
#include "backend/map/map_file.h"
#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

bool wait_for_file(const fs::path& path) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!fs::exists(path) && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return fs::exists(path);
}

TEST_CASE("map.hslam holds the map of the run, its options and the program") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  write_text(folder.path() / "options.yaml", "stereo:\n  ratio: 0.87\nsift: {upsample: false}\n");
  REQUIRE(run_slam(folder.path(), "data", {"--config", "options.yaml", "--seed", "7"}).code == 0);
  const LoadedMap loaded = load_map(folder.path() / "out/map.hslam");
  const nlohmann::json summary = read_json(folder.path() / "out/summary.json");
  CHECK(loaded.map.view().keyframe_count() == summary["keyframes"].get<std::size_t>());
  CHECK(loaded.map.view().landmark_count() == summary["landmarks"].get<std::size_t>());
  CHECK(loaded.map.view().landmark_count() > 200);
  CHECK(loaded.info.program ==
        "hybrid_slam 0.1.0 (" + summary["git_commit"].get<std::string>() + ")");
  write_text(folder.path() / "loaded.yaml", loaded.info.options);
  const SlamOptions options = read_slam_options((folder.path() / "loaded.yaml").string());
  CHECK(options.features == 400);
  CHECK(options.seed == 7);
  CHECK(options.stereo.ratio == 0.87);
  CHECK_FALSE(options.sift.upsample);
  CHECK(options.culling.redundancy.share == SlamOptions().culling.redundancy.share);
}

TEST_CASE("checkpoints change nothing of the result") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  REQUIRE(run_slam(folder.path(), "data", {"--out", "without"}).code == 0);
  REQUIRE(run_slam(folder.path(), "data", {"--out", "with", "--checkpoint-every", "1"}).code == 0);
  for (const char* const file : {"map.hslam", "stereo.tum"}) {
    INFO(file);
    CHECK(read_text(folder.path() / "without" / file) == read_text(folder.path() / "with" / file));
  }
  const nlohmann::json timing = read_json(folder.path() / "with/timing.json");
  CHECK(timing["checkpoint"]["count"] == timing["insert_keyframe"]["count"]);
  CHECK_FALSE(read_json(folder.path() / "without/timing.json").contains("checkpoint"));
}

TEST_CASE("a killed run leaves its last checkpoint") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data", 200);
  for (const char* const mode : {"every-frame", "realtime"}) {
    INFO(mode);
    const fs::path out = folder.path() / mode;
    ChildProcess program(
        HYBRID_SLAM,
        slam_arguments("data", {"--mode", mode, "--out", mode, "--checkpoint-every", "1"}),
        folder.path());
    REQUIRE(wait_for_file(out / "map.hslam"));
    program.send(SIGKILL);
    CHECK(program.finish(std::chrono::seconds(60)).signal == SIGKILL);
    const LoadedMap loaded = load_map(out / "map.hslam");
    CHECK(loaded.map.view().keyframe_count() >= 1);
    CHECK_FALSE(fs::exists(out / "summary.json"));
  }
}

TEST_CASE("a checkpoint that cannot be written is a warning, the map at the end an error") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  for (const char* const mode : {"every-frame", "realtime"}) {
    INFO(mode);
    const fs::path out = folder.path() / mode;
    fs::create_directories(out / "map.hslam");
    const Outcome outcome =
        run_slam(folder.path(), "data",
                 {"--quiet", "--mode", mode, "--out", mode, "--checkpoint-every", "1"});
    INFO(outcome.err);
    CHECK(outcome.code == 3);
    CHECK(count_lines(outcome.err, "warning: ") >= 1);
    CHECK(count_lines(outcome.err, "error: ") == 1);
    CHECK(count_lines(outcome.err, "map.hslam: cannot be written: Is a directory") ==
          count_lines(outcome.err));
    CHECK(read_json(out / "summary.json")["frames"]["tracked"] == kSurveyFrames);
    CHECK(fs::exists(out / "stereo.tum"));
  }
}

TEST_CASE("a report that cannot be written costs a run nothing else") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  fs::create_directories(folder.path() / "out/report.html/below");
  const Outcome outcome = run_slam(folder.path(), "data", {"--quiet"});
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(count_lines(outcome.err, "warning: no report: ") == 1);
  CHECK(count_lines(outcome.err, "report.html") == 1);
  CHECK(fs::exists(folder.path() / "out/map.hslam"));
  CHECK(fs::exists(folder.path() / "out/summary.json"));
}

TEST_CASE("a full disk ends in one line and code 3") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  const std::string command = "trap '' XFSZ; ulimit -f 100; exec " HYBRID_SLAM " data --quiet";
  const Outcome outcome = run_program("/bin/sh", {"-c", command}, folder.path());
  check_refused(outcome, 3, "cannot be written: File too large");
  CHECK_FALSE(fs::exists(folder.path() / "out/summary.json"));
}

}  // namespace
}  // namespace hybrid_slam
