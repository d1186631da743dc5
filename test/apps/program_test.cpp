#include <algorithm>
#include <csignal>
#include <set>
#include <sstream>
#include <thread>

#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "apps/io/trajectory.h"
#include "apps/report/result_table.h"
#include "frontend/features/sift_device.h"
#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr double kMaxAte = 0.003;  // [m]; the path is 1.6 m long, the ground 2 m away
constexpr const char* kResults[] = {
    "stereo.tum",    "stereo_online.tum", "map.hslam",       "map.ply",
    "map.png",       "loops.csv",         "timing.json",     "timing.csv",
    "summary.json",  "frames.csv",        "errors.csv",      "keyframes.csv",
    "residuals.csv", "coverage.csv",      "calibration.csv", "report.html"};

std::string engine_by_default() {
  return to_string(why_no_cuda_sift({}).empty() ? SiftDevice::kCuda : SiftDevice::kCpu);
}

void check_frames(const Json& summary, int read, int tracked, int corrupt = 0) {
  INFO(summary.dump(1));
  const Json& frames = summary["frames"];
  CHECK(frames.size() == 7);
  CHECK(frames["coasted"] == 0);
  CHECK(frames["other_components"] == 0);
  CHECK(frames["read"] == read);
  CHECK(frames["tracked"] == tracked);
  CHECK(frames["lost"] == read - tracked - corrupt);
  CHECK(frames["dropped"] == 0);
  CHECK(frames["corrupt"] == corrupt);
}

// Every result is there, nothing else is, and they agree with each other.
Json check_results(const fs::path& out) {
  std::set<std::string> found;
  for (const auto& entry : fs::directory_iterator(out)) found.insert(entry.path().filename());
  CHECK(found == std::set<std::string>(std::begin(kResults), std::end(kResults)));
  Json summary = read_json(out / "summary.json");
  const auto tracked = summary["frames"]["tracked"].get<std::size_t>();
  CHECK(read_trajectory(out / "stereo.tum").poses.size() == tracked);
  CHECK(read_trajectory(out / "stereo_online.tum").poses.size() == tracked);
  const std::string ply = read_text(out / "map.ply");
  CHECK(ply.starts_with("ply\n"));
  const cv::Mat picture = cv::imread((out / "map.png").string());
  CHECK(picture.cols > 200);
  CHECK(picture.rows > 200);
  int from = 0;
  for (const auto& [source, count] : summary["poses_from"].items()) {
    from += source == "lost" ? 0 : count.get<int>();
  }
  CHECK(from == static_cast<int>(tracked));
  return summary;
}

// A row per stereo frame; together, what a run of so many seconds can have used.
void check_frame_times(const fs::path& out, double seconds) {
  std::istringstream rows(read_text(out / "timing.csv"));
  std::string row;
  REQUIRE(std::getline(rows, row));
  CHECK(row == "time,cpu_ms,behind_ms");
  const Trajectory poses = read_trajectory(out / "stereo.tum").poses;
  double sum = 0;
  for (const StampedPose& pose : poses) {
    REQUIRE(std::getline(rows, row));
    const std::size_t comma = row.find(',');
    CHECK(std::stod(row.substr(0, comma)) == Approx(pose.time).margin(1e-6));
    const double cpu_ms = std::stod(row.substr(comma + 1));
    CHECK(cpu_ms > 0);
    sum += cpu_ms;
    CHECK(row.back() == ',');  // nobody's clock gives the images: none is behind
  }
  CHECK_FALSE(std::getline(rows, row));
  CHECK(sum > 1e3 * 0.05 * seconds);
  CHECK(sum < 1e3 * seconds * std::thread::hardware_concurrency());
}

TEST_CASE("hybrid_slam tracks a survey and writes what it documents") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  const Outcome outcome = run_slam(folder.path(), "data", {"--out", "deep/results", "--seed", "7"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(count_lines(outcome.err, "8 stereo frames of 320x240") == 1);
  CHECK(count_lines(outcome.err, "error") == 0);
  CHECK(count_lines(outcome.err, "warning") == 0);
  CHECK(count_lines(outcome.out, "8 read, 8 tracked, 0 lost, 0 dropped, 0 corrupt") == 1);
  const fs::path out = folder.path() / "deep/results";
  const Json summary = check_results(out);
  check_frames(summary, kSurveyFrames, kSurveyFrames);
  CHECK(summary["sequence"] == "00");
  CHECK(summary["layout"] == "kitti");
  CHECK(summary["poses_from"] == Json({{"initialization", 1}, {"local_map", 7}}));
  CHECK(summary["predictions_from"]["odometer"] == 7);
  CHECK(summary["keyframes"].get<int>() >= 2);
  CHECK(summary["landmarks"].get<int>() >= 200);
  CHECK(summary["interrupted"] == false);
  CHECK(summary["internal_errors"] == Json::array());
  CHECK(summary["seed"] == 7);
  CHECK(summary["sift_engine"] == engine_by_default());
  CHECK(summary["options"]["features"] == 400);
  CHECK(summary["options"]["mode"] == "every-frame");
  CHECK(summary["blas"].get<std::string>().find("blas") != std::string::npos);
  CHECK_FALSE(summary["git_commit"].get<std::string>().empty());
  CHECK(summary["ate"]["position_m"]["count"] == kSurveyFrames);
  CHECK(summary["ate"]["position_m"]["rmse"].get<double>() < kMaxAte);
  CHECK(summary["ate"]["length_ratio"].get<double>() == Approx(1).margin(0.01));
  const Json timing = read_json(out / "timing.json");
  for (const auto& [stage, times] : timing.items()) {
    INFO(stage);
    CHECK(times["count"].get<int>() > 0);
    CHECK(times["p50"].get<double>() <= times["p99"].get<double>());
    CHECK(times["p99"].get<double>() <= times["max"].get<double>());
  }
  CHECK(timing["track"]["count"] == kSurveyFrames);
  CHECK(summary["options_changed"]["features"] == "400");
  CHECK(summary["images_xxh3"].get<std::string>().size() == 16);
  CHECK(summary["residuals"]["stereo"]["rms_px"].get<double>() < 1);
  CHECK(summary["coverage"]["area_m2"].get<double>() > 0);
  CHECK(count_lines(read_text(out / "errors.csv"), "stereo,") == kSurveyFrames);
  CHECK(fs::file_size(out / "report.html") < 5'000'000);
  check_frame_times(out, summary["seconds"].get<double>());
}

TEST_CASE("poses are those of the left camera, in the dataset's times") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  REQUIRE(run_slam(folder.path(), "data", {"--quiet"}).code == 0);
  for (const char* const file : {"stereo.tum", "stereo_online.tum"}) {
    const Trajectory poses = read_trajectory(folder.path() / "out" / file).poses;
    REQUIRE(poses.size() == kSurveyFrames);
    for (int i = 0; i < kSurveyFrames; ++i) {
      const StampedPose& pose = poses[static_cast<std::size_t>(i)];
      INFO(file << ", frame " << i);
      CHECK(pose.time == Approx(kSurveyPeriod * i).margin(1e-6));
      const Rigid3d error = inverse(inverse(survey_pose(0)) * survey_pose(i)) * pose.world_from_cam;
      CHECK(error.translation().norm() < 3 * kMaxAte);
      CHECK(error.rotation().angularDistance(Eigen::Quaterniond::Identity()) < 0.003);
    }
  }
}

TEST_CASE("trajectory_eval agrees with the summary") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  REQUIRE(run_slam(folder.path(), "data", {"--quiet"}).code == 0);
  const Outcome outcome = run_program(TRAJECTORY_EVAL,
                                      {"ate", "out/stereo.tum", "data/poses/00.txt", "--times",
                                       "data/sequences/00/times.txt", "--json"},
                                      folder.path());
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const Json ate = read_json(folder.path() / "out/summary.json")["ate"];
  CHECK(Json::parse(outcome.out)["position_m"]["rmse"].get<double>() ==
        Approx(ate["position_m"]["rmse"].get<double>()).epsilon(1e-3));
}

TEST_CASE("every-frame runs give the same bytes, whatever the number of threads") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  for (const char* const threads : {"1", "3"}) {
    REQUIRE(
        run_slam(folder.path(), "data", {"--quiet", "--threads", threads, "--out", threads}).code ==
        0);
  }
  CHECK(read_json(folder.path() / "1/summary.json")["images_xxh3"] ==
        read_json(folder.path() / "3/summary.json")["images_xxh3"]);
  for (const char* const file : {"stereo.tum", "stereo_online.tum", "map.ply", "map.hslam"}) {
    INFO(file);
    CHECK(read_text(folder.path() / "1" / file) == read_text(folder.path() / "3" / file));
  }
}

TEST_CASE("realtime mode tracks every frame when images wait for it") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  const Outcome outcome =
      run_slam(folder.path(), "data", {"--mode", "realtime", "--device", "auto"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const Json summary = check_results(folder.path() / "out");
  check_frames(summary, kSurveyFrames, kSurveyFrames);
  CHECK(summary["options"]["mode"] == "realtime");
  CHECK(summary["sift_engine"] == engine_by_default());
  CHECK(summary["ate"]["position_m"]["rmse"].get<double>() < kMaxAte);
}

TEST_CASE("realtime mode drops and counts images that come too fast") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data", 40);
  const Outcome outcome =
      run_slam(folder.path(), "data", {"--mode", "realtime", "--rate", "2000", "--threads", "1"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const Json frames = check_results(folder.path() / "out")["frames"];
  INFO(frames.dump());
  CHECK(frames["dropped"].get<int>() >= 20);
  CHECK(frames["tracked"].get<int>() >= 1);
  CHECK(frames["read"].get<int>() + frames["dropped"].get<int>() == 40);
}

TEST_CASE("realtime mode says how far behind the images each frame was tracked") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  const Outcome outcome = run_slam(folder.path(), "data", {"--mode", "realtime", "--rate", "4"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const ResultTable times(folder.path() / "out/timing.csv");
  REQUIRE(times.size() > 0);
  double most = 0;
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double behind = times.number(i, "behind_ms");
    CHECK(behind > 0);
    most = std::max(most, behind);
  }
  const Json summary = read_json(folder.path() / "out/summary.json");
  CHECK(summary["behind_ms"]["max"].get<double>() == Approx(most));
  CHECK(most < 1e3 * summary["seconds"].get<double>());
  const ResultTable frames(folder.path() / "out/frames.csv");
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (frames.text(i, "state") == "dropped") continue;
    CHECK(frames.number(i, "row_error_px") < 1);  // the survey's cameras are perfect
  }
}

TEST_CASE("A limit ends the run early") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  REQUIRE(run_slam(folder.path(), "data", {"--limit", "3"}).code == 0);
  check_frames(check_results(folder.path() / "out"), 3, 3);
}

TEST_CASE("options come from the file, and the command line goes before it") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  write_text(folder.path() / "options.yaml",
             "features: 700\nseed: 3\nsift:\n  upsample: false\n  contrast_threshold: 1.5\n");
  const std::vector<std::string> arguments{"data",     "--config", "options.yaml", "--seed",
                                           "4",        "--quiet",  "--limit",      "2",
                                           "--device", "cpu"};
  const Outcome outcome = run_program(HYBRID_SLAM, arguments, folder.path());
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(outcome.err.empty());
  const Json summary = read_json(folder.path() / "out/summary.json");
  CHECK(summary["options"]["features"] == 700);
  CHECK(summary["options"]["upsample"] == false);
  CHECK(summary["options"]["contrast_threshold"] == 1.5);
  CHECK(summary["seed"] == 4);
  CHECK(summary["sift_engine"] == "cpu");
}

TEST_CASE("the other layouts are found out and tracked alike") {
  const TempFolder folder;
  SECTION("EuRoC, without truth") {
    write_euroc_survey(folder.path() / "data");
    REQUIRE(run_slam(folder.path(), "data").code == 0);
    const Json summary = check_results(folder.path() / "out");
    check_frames(summary, kSurveyFrames, kSurveyFrames);
    CHECK(summary["layout"] == "euroc");
    CHECK(summary["ate"].is_null());
  }
  for (const bool inverted : {false, true}) {
    DYNAMIC_SECTION("UWslam, truth " << (inverted ? "cam_from_world" : "world_from_cam")) {
      write_uwslam_survey(folder.path() / "data", inverted);
      const Outcome outcome = run_slam(folder.path(), "data", {"--cameras", "stereo"});
      INFO(outcome.err);
      REQUIRE(outcome.code == 0);
      const Json summary = check_results(folder.path() / "out");
      check_frames(summary, kSurveyFrames, kSurveyFrames);
      CHECK_FALSE(summary.contains("fisheye"));
      CHECK(summary["options"]["cameras"] == "stereo");
      CHECK(summary["layout"] == "uwslam");
      CHECK(summary["truth_convention"] == (inverted ? "cam_from_world" : "world_from_cam"));
      CHECK(summary["ate"]["position_m"]["rmse"].get<double>() < kMaxAte);
    }
  }
}

TEST_CASE("an interrupted run saves what there is") {
  const TempFolder folder;
  constexpr int kFrames = 200;
  write_kitti_survey(folder.path() / "data", kFrames);
  std::vector<std::string> more;
  int first_damaged = 20;
  int last_damaged = 20;
  int min_tracked = 4;
  SECTION("every-frame") { more = {"--mode", "every-frame"}; }
  SECTION("realtime") { more = {"--mode", "realtime"}; }
  SECTION("realtime, waiting for the next image") {
    more = {"--mode", "realtime", "--rate", "5"};
    first_damaged = 10;
    last_damaged = 60;  // on a busy machine, those that come first are dropped
    min_tracked = 1;
  }
  // The warning about a damaged image tells that the frames before it have been read; at most half
  // a second of them waits to be put in order, and three to be tracked.
  for (int i = first_damaged; i <= last_damaged; ++i) {
    write_text(kitti_image(folder.path() / "data", true, i), "no image");
  }
  for (const int signal : {SIGINT, SIGTERM}) {
    ChildProcess program(HYBRID_SLAM, slam_arguments("data", more), folder.path());
    REQUIRE(program.wait_for_error_text("neither PNG nor JPEG", std::chrono::seconds(60)));
    program.send(signal);
    const Outcome outcome = program.finish(std::chrono::seconds(60));
    INFO(outcome.err);
    CHECK(outcome.signal == 0);
    CHECK(outcome.code == 130);
    CHECK(count_lines(outcome.err, "interrupted: results up to frame") == 1);
    const Json summary = check_results(folder.path() / "out");
    CHECK(summary["interrupted"] == true);
    CHECK(summary["frames"]["tracked"].get<int>() >= min_tracked);
    CHECK(summary["frames"]["read"].get<int>() < kFrames);
    fs::remove_all(folder.path() / "out");
  }
}

TEST_CASE("help is printed, with layouts, results and exit codes") {
  const TempFolder folder;
  const Outcome outcome = run_program(HYBRID_SLAM, {"--help"}, folder.path());
  CHECK(outcome.code == 0);
  CHECK(outcome.err.empty());
  for (const char* const word :
       {"--layout", "--sequence", "--config", "--out", "--mode", "--rate", "--cameras",
        "--features", "--seed", "--threads", "--device", "--limit", "--checkpoint-every", "--quiet",
        "--vocabulary", "stereo_online.tum", "Exit codes", "130"}) {
    INFO(word);
    CHECK(outcome.out.find(word) != std::string::npos);
  }
}

}  // namespace
}  // namespace hybrid_slam
