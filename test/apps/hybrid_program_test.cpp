#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>

#include "apps/io/trajectory.h"
#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// Of the arm, 1.4 m long [m]: a pixel of the fisheye, whose focal length is 118 px.
constexpr double kMaxError = 0.012;

fs::path fisheye_image(const fs::path& data, int frame) {
  return data / "hybrid/M1/images/raw" / (std::to_string(frame) + "_fish.png");
}

void check_fisheye(const Json& summary, int registered, int missing) {
  INFO(summary.dump(1));
  const Json& fisheye = summary["fisheye"];
  CHECK(fisheye["frames"]["read"] == kSurveyFrames);
  CHECK(fisheye["frames"]["registered"] == registered);
  CHECK(fisheye["frames"]["missing"] == missing);
  CHECK(fisheye["relative_pose_error"]["registered"] == registered);
  CHECK(fisheye["relative_pose_error"]["total"] == kSurveyFrames);
  CHECK(fisheye["relative_pose_error"]["translation_m"]["max"].get<double>() < kMaxError);
}

TEST_CASE("a survey with a fisheye is tracked with both cameras") {
  const TempFolder folder;
  write_uwslam_survey(folder.path() / "data", false);
  for (const std::string mode : {"every-frame", "realtime"}) {
    for (const std::string cameras : {"auto", "hybrid"}) {
      const Outcome outcome =
          run_slam(folder.path(), "data", {"--mode", mode, "--cameras", cameras});
      INFO(outcome.err);
      REQUIRE(outcome.code == 0);
      CHECK(count_lines(outcome.err, "warning") == 0);
      CHECK(count_lines(outcome.out, "8 read, 8 registered, 0 lost, 0 missing") == 1);
      const fs::path out = folder.path() / "out";
      const Json summary = read_json(out / "summary.json");
      CHECK(summary["frames"]["tracked"] == kSurveyFrames);
      CHECK(summary["options"]["cameras"] == "hybrid");
      check_fisheye(summary, kSurveyFrames, 0);
      CHECK(read_json(out / "timing.json")["track_fisheye"]["count"] == kSurveyFrames);
      for (const char* const file : {"fisheye.tum", "fisheye_online.tum"}) {
        const Trajectory poses = read_trajectory(out / file).poses;
        REQUIRE(poses.size() == kSurveyFrames);
        for (int i = 0; i < kSurveyFrames; ++i) {
          const StampedPose& pose = poses[static_cast<std::size_t>(i)];
          const Rigid3d truth = inverse(survey_pose(0)) * survey_fisheye_pose(i);
          CHECK(pose.time == Approx(kSurveyPeriod * i).margin(1e-6));
          CHECK((pose.world_from_cam.translation() - truth.translation()).norm() < 2 * kMaxError);
        }
      }
      const Outcome evaluation =
          run_program(TRAJECTORY_EVAL, {"hybrid", "out", "data/hybrid/M1"}, folder.path());
      INFO(evaluation.err);
      CHECK(evaluation.code == 0);
      CHECK(count_lines(evaluation.out, "8 of 8 fisheye frames (100.0 %)") == 1);
      CHECK(count_lines(evaluation.out, "world_from_cam") == 1);
    }
  }
}

TEST_CASE("fisheye images that are missing or damaged leave the stereo pair alone") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_uwslam_survey(data, false);
  fs::remove(fisheye_image(data, 2));
  fs::resize_file(fisheye_image(data, 5), fs::file_size(fisheye_image(data, 5)) / 2);
  const Outcome outcome = run_slam(folder.path(), "data");
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(count_lines(outcome.err, "frame 2: no fisheye image") == 1);
  CHECK(count_lines(outcome.err, "5_fish.png: truncated PNG") == 1);
  Json summary = read_json(folder.path() / "out/summary.json");
  CHECK(summary["frames"]["tracked"] == kSurveyFrames);
  CHECK(summary["frames"]["corrupt"] == 0);
  check_fisheye(summary, kSurveyFrames - 2, 2);
  for (int i = 0; i < kSurveyFrames; ++i) fs::remove(fisheye_image(data, i));
  const Outcome none = run_slam(folder.path(), "data", {"--cameras", "hybrid"});
  CHECK(none.code == 0);
  CHECK(count_lines(none.err, "holds no fisheye images") == 1);
  summary = read_json(folder.path() / "out/summary.json");
  CHECK(summary["frames"]["tracked"] == kSurveyFrames);
  CHECK(summary["options"]["cameras"] == "stereo");
}

TEST_CASE("a fisheye calibration or mask that cannot be used ends in one line and code 3") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_uwslam_survey(data, false);
  const fs::path calibration = data / "hybrid/calibration/fisheye_calib.yaml";
  const std::string text = read_text(calibration);
  const auto refused = [&](const std::string& reason) {
    check_refused(run_slam(folder.path(), "data", {"--quiet", "--config", "options.yaml"}), 3,
                  reason);
  };
  write_text(folder.path() / "options.yaml", "seed: 1\n");
  std::string broken = text;
  write_text(calibration, broken.replace(broken.find("fx: 118"), 7, "fx: nan"));
  refused("fisheye_calib.yaml");
  broken = text;
  write_text(calibration, broken.replace(broken.find("k1: -0.01"), 9, "k1: -0.25"));
  refused("the field of view folds");
  write_text(calibration, text);
  write_text(folder.path() / "options.yaml", "fisheye:\n  mask: mask.png\n");
  refused("mask.png");
  REQUIRE(cv::imwrite((folder.path() / "mask.png").string(), cv::Mat::ones(90, 80, CV_8UC1)));
  refused("mask.png: image is 80x90, expected 360x360");
}

}  // namespace
}  // namespace hybrid_slam
