// What hybrid_slam writes while it runs.
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <fstream>
#include <sstream>
#include <thread>
#include <vector>

#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

std::vector<std::vector<std::string>> read_csv(const fs::path& path) {
  std::vector<std::vector<std::string>> rows;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::vector<std::string> row;
    std::istringstream fields(line + ",");
    for (std::string field; std::getline(fields, field, ',');) row.push_back(field);
    rows.push_back(row);
  }
  return rows;
}

// Of a row, by the column's name.
std::string field(const std::vector<std::vector<std::string>>& csv, std::size_t row,
                  const std::string& name) {
  for (std::size_t i = 0; i < csv.front().size(); ++i) {
    if (csv.front()[i] == name) return csv.at(row).at(i);
  }
  FAIL("no column " << name);
  return {};
}

TEST_CASE("Each camera frame has a row with its state, pose and covariance") {
  const TempFolder folder;
  write_uwslam_survey(folder.path() / "data", false);
  const Outcome outcome = run_slam(folder.path(), "data", {"--log", "slam.log"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const auto frames = read_csv(folder.path() / "out/frames.csv");
  REQUIRE(frames.size() == 1 + 2 * kSurveyFrames);
  for (const auto& row : frames) CHECK(row.size() == frames.front().size());
  for (std::size_t i = 1; i < frames.size(); ++i) {
    CHECK(field(frames, i, "camera") == (i % 2 == 1 ? "stereo" : "fisheye"));
    CHECK(std::stod(field(frames, i, "time")) ==
          Approx(kSurveyPeriod * static_cast<double>((i - 1) / 2)).margin(1e-6));
    CHECK((field(frames, i, "state") == "map" || field(frames, i, "state") == "relocalised"));
    CHECK(field(frames, i, "causes").empty());
    const int moment = static_cast<int>((i - 1) / 2);
    const Rigid3d truth =
        inverse(survey_pose(0)) * (i % 2 == 1 ? survey_pose(moment) : survey_fisheye_pose(moment));
    CHECK(std::stod(field(frames, i, "tx")) == Approx(truth.translation().x()).margin(0.03));
    const double sigma = std::stod(field(frames, i, "sigma_position"));
    CHECK(sigma < 0.15);  // of cameras of 320x240 pixels
    CHECK((sigma > 1e-5 || moment == 0));
    CHECK(sigma * sigma ==
          Approx(std::stod(field(frames, i, "cov_x_x")) + std::stod(field(frames, i, "cov_y_y")) +
                 std::stod(field(frames, i, "cov_z_z")))
              .epsilon(1e-3)
              .margin(1e-12));
  }
  const auto arm = read_csv(folder.path() / "out/fisheye_in_left.csv");
  REQUIRE(arm.size() == 1 + kSurveyFrames);
  for (int i = 0; i < kSurveyFrames; ++i) {
    const Rigid3d truth = inverse(survey_pose(i)) * survey_fisheye_pose(i);
    CHECK(std::stod(field(arm, static_cast<std::size_t>(i + 1), "tz")) ==
          Approx(truth.translation().z()).margin(0.02));
  }
  const nlohmann::json summary = read_json(folder.path() / "out/summary.json");
  CHECK(summary["states"]["map"] == kSurveyFrames);
  CHECK(summary["states"]["lost"] == 0);
  CHECK(summary["causes"].empty());
  CHECK(summary["fisheye"]["states"]["lost"] == 0);
  CHECK(read_text(folder.path() / "slam.log").find("hybrid_slam.tracking: stereo") !=
        std::string::npos);
}

TEST_CASE("A killed run leaves its frames and poses") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data", 200);
  for (const char* const mode : {"every-frame", "realtime"}) {
    INFO(mode);
    const fs::path out = folder.path() / mode;
    ChildProcess program(HYBRID_SLAM, slam_arguments("data", {"--mode", mode, "--out", mode}),
                         folder.path());
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    std::size_t rows = 0;
    while (rows < 11 && std::chrono::steady_clock::now() < deadline) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      rows = read_csv(out / "frames.csv").size();
    }
    program.send(SIGKILL);
    CHECK(program.finish(std::chrono::seconds(60)).signal == SIGKILL);
    const std::size_t frames = read_csv(out / "frames.csv").size() - 1;
    CHECK(frames >= 10);
    for (const char* const file : {"stereo.tum", "stereo_online.tum"}) {
      INFO(file);
      const std::string poses = read_text(out / file);
      CHECK(poses.ends_with('\n'));
      CHECK(static_cast<std::size_t>(count_lines(poses)) + 1 >= frames);
      CHECK(static_cast<std::size_t>(count_lines(poses)) <= frames);
    }
  }
}

TEST_CASE("A disk that is full while a run goes on is a warning") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  fs::create_directories(folder.path() / "out");
  fs::create_symlink("/dev/full", folder.path() / "out/frames.csv");
  const Outcome outcome = run_slam(folder.path(), "data", {"--quiet"});
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(count_lines(outcome.err, "frames.csv: No space left on device") == 1);
  CHECK(count_lines(read_text(folder.path() / "out/stereo.tum")) == kSurveyFrames);
}

TEST_CASE("An image that cannot be read has a row of its own") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  write_text(kitti_image(folder.path() / "data", false, 3), "no image");
  const Outcome outcome = run_slam(folder.path(), "data", {"--quiet"});
  REQUIRE(outcome.code == 0);
  const auto frames = read_csv(folder.path() / "out/frames.csv");
  REQUIRE(frames.size() == 1 + kSurveyFrames);
  int corrupt = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    CHECK(frames[i].size() == frames.front().size());
    corrupt += field(frames, i, "state") == "corrupt" ? 1 : 0;
  }
  CHECK(corrupt == 1);
}

}  // namespace
}  // namespace hybrid_slam
