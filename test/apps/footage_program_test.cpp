#include <cmath>

#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

// Images that lie in no known layout, as the user of the program names them.
namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

Outcome run(const fs::path& folder, std::vector<std::string> arguments, const std::string& out) {
  for (const char* const more : {"--features", "400", "--quiet", "--out"}) {
    arguments.emplace_back(more);
  }
  arguments.push_back(out);
  Outcome outcome = run_program(HYBRID_SLAM, arguments, folder);
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  return outcome;
}

// A ROS calibration of the survey's cameras whose raw images stand `rows` px lower: a camera that
// is turned about its horizontal axis.
std::string tilted_ros_camera(double p3, double rows) {
  const auto camera = survey_camera();
  const auto& [fx, fy, cx, cy, baseline] = camera.params;
  const double angle = std::atan(rows / fy);
  return fmt::format(
      "image_width: {0}\nimage_height: {1}\n"
      "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [{2}, 0, {4}, 0, {3}, {5}, 0, 0, 1]\n"
      "distortion_model: plumb_bob\n"
      "distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 0, 0, 0, 0]\n"
      "rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, {6}, {7}, 0, {8}, {6}]\n"
      "projection_matrix:\n  rows: 3\n  cols: 4\n"
      "  data: [{2}, 0, {4}, {9}, 0, {3}, {5}, 0, 0, 0, 1, 0]\n",
      camera.width, camera.height, fx, fy, cx, cy, std::cos(angle), -std::sin(angle),
      std::sin(angle), p3);
}

}  // namespace

TEST_CASE("own footage gives the same bytes as the dataset that it is of") {
  const TempFolder folder;
  SECTION("KITTI's images") {
    write_kitti_survey(folder.path() / "data");
    run(folder.path(), {"data"}, "a");
    run(folder.path(),
        {"--left", "data/sequences/00/image_0", "--right", "data/sequences/00/image_1",
         "--calibration", "data/sequences/00/calib.txt", "--times", "data/sequences/00/times.txt"},
        "b");
  }
  SECTION("UWslam's, with a fisheye") {
    write_uwslam_survey(folder.path() / "data", false);
    run(folder.path(), {"data"}, "a");
    run(folder.path(),
        {"--left", "data/hybrid/M1/images/raw/*_left.png", "--right",
         "data/hybrid/M1/images/raw/*_right.png", "--fisheye",
         "data/hybrid/M1/images/raw/*_fish.png", "--calibration",
         "data/hybrid/calibration/left_camera.yaml", "data/hybrid/calibration/right_camera.yaml",
         "data/hybrid/calibration/fisheye_calib.yaml", "--times", "data/hybrid/M1/times.txt"},
        "b");
    const std::string fisheye = read_text(folder.path() / "a/fisheye.tum");
    CHECK(count_lines(fisheye) > 4);
    CHECK(read_text(folder.path() / "b/fisheye.tum") == fisheye);
  }
  SECTION("EuRoC's, with times in their names") {
    write_euroc_survey(folder.path() / "data");
    run(folder.path(), {"data"}, "a");
    run(folder.path(),
        {"--left", "data/mav0/cam0/data", "--right", "data/mav0/cam1/data", "--calibration",
         "data/mav0/cam0/sensor.yaml", "data/mav0/cam1/sensor.yaml"},
        "b");
  }
  SECTION("every second frame of a dataset") {
    write_kitti_survey(folder.path() / "data");
    run(folder.path(), {"data", "--start", "1", "--every", "2"}, "a");
    run(folder.path(),
        {"--left", "data/sequences/00/image_0/*[1357].png", "--right",
         "data/sequences/00/image_1/*[1357].png", "--calibration", "data/sequences/00/calib.txt",
         "--times", "data/sequences/00/times.txt"},
        "b");
    CHECK(count_lines(read_text(folder.path() / "a/stereo.tum")) == 4);
    CHECK(read_json(folder.path() / "a/summary.json")["options"]["every"] == 2);
  }
  const std::string poses = read_text(folder.path() / "a/stereo.tum");
  CHECK(count_lines(poses) > 2);
  CHECK(read_text(folder.path() / "b/stereo.tum") == poses);
  CHECK(read_json(folder.path() / "b/summary.json")["layout"] == "footage");
}

TEST_CASE("whether images are raw or rectified is found by their rows") {
  constexpr double kRows = 3;
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_kitti_survey(data);
  const auto camera = survey_camera();
  write_text(folder.path() / "left.yaml", tilted_ros_camera(0, 0));
  write_text(folder.path() / "right.yaml",
             tilted_ros_camera(-camera.params[0] * camera.params[4], kRows));
  const std::vector<std::string> arguments{"check",
                                           "--left",
                                           "data/sequences/00/image_0",
                                           "--right",
                                           "data/sequences/00/image_1",
                                           "--calibration",
                                           "left.yaml",
                                           "right.yaml",
                                           "--fps",
                                           "5",
                                           "--features",
                                           "400",
                                           "--quiet",
                                           "--json",
                                           "check.json"};
  const auto checked = [&](const std::vector<std::string>& more) {
    std::vector<std::string> all = arguments;
    all.insert(all.end(), more.begin(), more.end());
    const Outcome outcome = run_program(HYBRID_SLAM, all, folder.path());
    INFO(outcome.err);
    REQUIRE(fs::exists(folder.path() / "check.json"));
    return std::pair(outcome, read_json(folder.path() / "check.json"));
  };
  const auto rows_of = [](const nlohmann::json& json) {
    return json["rows"]["error_px"].get<double>();
  };
  auto [as_is, json] = checked({});
  CHECK(as_is.code == 0);
  CHECK(count_lines(as_is.out, "the images are taken for rectified ones") == 1);
  CHECK(rows_of(json) < 0.4);
  const auto forced = checked({"--images", "raw"});
  CHECK(forced.first.code == 5);
  CHECK(rows_of(forced.second) == Approx(kRows).margin(0.5));

  for (int i = 0; i < kSurveyFrames; ++i) {  // what the tilted camera would have taken, nearly
    const std::string path = kitti_image(data, true, i).string();
    const cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE);
    const cv::Mat change = (cv::Mat_<double>(2, 3) << 1, 0, 0, 0, 1, kRows);
    cv::Mat lower;
    cv::warpAffine(image, lower, change, image.size(), cv::INTER_NEAREST, cv::BORDER_REPLICATE);
    REQUIRE(cv::imwrite(path, lower));
  }
  const auto raw = checked({});
  CHECK(raw.first.code == 0);
  CHECK(count_lines(raw.first.out, "the images are taken for raw ones") == 1);
  CHECK(rows_of(raw.second) < 0.6);
}

TEST_CASE("options of own footage that do not go together") {
  const TempFolder folder;
  const auto refused = [&](const std::vector<std::string>& arguments, const std::string& reason) {
    check_refused(run_program(HYBRID_SLAM, arguments, folder.path()), 2, reason);
  };
  refused({"data", "--left", "l", "--right", "r", "--calibration", "c"}, "one or the other");
  refused({"--left", "l"}, "--left needs --right");
  refused({"--right", "r"}, "--right needs --left");
  refused({"--left", "l", "--right", "r"}, "--left needs --calibration");
  refused({"data", "--fps", "5"}, "need --left and --right");
  refused({"--left", "l", "--right", "r", "--calibration", "c", "--fps", "5", "--times", "t"},
          "one or the other");
  refused({"--left", "l", "--right", "r", "--calibration", "c", "--layout", "kitti"},
          "need a DATASET");
  refused({"data", "--every", "0"}, "--every");
  refused({"data", "--start", "-1"}, "--start");
  check_refused(run_program(HYBRID_SLAM, {"--left", "l", "--right", "r", "--calibration", "c"},
                            folder.path()),
                3, "l: no such folder or file");
}

}  // namespace hybrid_slam
