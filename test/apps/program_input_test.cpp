#include <unistd.h>

#include <catch2/catch.hpp>

#include <opencv2/imgcodecs.hpp>

#include "frontend/features/sift_device.h"
#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

void replace_text(const fs::path& path, const std::string& from, const std::string& to) {
  std::string text = read_text(path);
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  write_text(path, text.replace(at, from.size(), to));
}

TEST_CASE("a damaged or missing image in the middle is skipped, counted and named") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_kitti_survey(data);
  const fs::path image = kitti_image(data, true, 3);
  std::string warning;
  SECTION("truncated") {
    fs::resize_file(image, fs::file_size(image) / 2);
    warning = "image_1/000003.png: truncated PNG";
  }
  SECTION("missing") {
    fs::remove(image);
    warning = "frame 3: no right image";
  }
  SECTION("of another size") {
    cv::imwrite(image.string(), cv::Mat::zeros(120, 160, CV_8UC1));
    warning = "image_1/000003.png: image is 160x120, expected 320x240";
  }
  for (const char* const mode : {"every-frame", "realtime"}) {
    const Outcome outcome = run_slam(folder.path(), "data", {"--quiet", "--mode", mode});
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    CHECK(count_lines(outcome.err, warning) == 1);
    CHECK(count_lines(outcome.err, "error:") == 0);
    const Json frames = read_json(folder.path() / "out/summary.json")["frames"];
    CHECK(frames["read"] == kSurveyFrames);
    CHECK(frames["corrupt"] == 1);
    CHECK(frames["tracked"] == kSurveyFrames - 1);
  }
}

TEST_CASE("a featureless frame in the middle is lost or bridged, never fatal") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_kitti_survey(data);
  for (const bool right : {false, true}) {
    cv::imwrite(kitti_image(data, right, 4).string(), cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)));
  }
  const Outcome outcome = run_slam(folder.path(), "data", {"--quiet"});
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  const Json frames = read_json(folder.path() / "out/summary.json")["frames"];
  CHECK(frames["lost"].get<int>() + frames["coasted"].get<int>() == 1);
  CHECK(frames["tracked"] == kSurveyFrames - 1);
}

TEST_CASE("a dataset that cannot be used is refused with one line and code 3") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  const fs::path sequence = data / "sequences/00";
  write_kitti_survey(data);
  std::string reason;
  SECTION("missing") {
    fs::remove_all(data);
    reason = "data: no such folder";
  }
  SECTION("empty") {
    fs::remove_all(data);
    fs::create_directory(data);
    reason = "data: no sequence in a known layout here";
  }
  SECTION("a file") {
    fs::remove_all(data);
    write_text(data, "x");
    reason = "data: no bag: neither ROS 1, MCAP nor rosbag2's sqlite3";
  }
  SECTION("no images") {
    for (int i = 0; i < kSurveyFrames; ++i) {
      for (const bool right : {false, true}) fs::remove(kitti_image(data, right, i));
    }
    reason = "image_0: holds no images";
  }
  SECTION("no right images") {
    fs::remove_all(sequence / "image_1");
    reason = "image_1: no such folder";
  }
  SECTION("most right images missing") {
    for (int i = 3; i < kSurveyFrames; ++i) fs::remove(kitti_image(data, true, i));
    reason = "sequences/00: 5 of 8 frames lack an image (first: frame 3, right)";
  }
  SECTION("more images than times") {
    write_text(sequence / "times.txt", "0\n0.2\n0.4\n0.6\n0.8\n");
    reason = "times.txt: has 5 times, but there are images up to number 7";
  }
  SECTION("times out of order") {
    replace_text(sequence / "times.txt", "0.600000\n", "0.400000\n");
    reason = "times.txt:4: times are not strictly ascending";
  }
  SECTION("a calibration value is not a number") {
    replace_text(sequence / "calib.txt", "P1: 260", "P1: nan");
    reason = "calib.txt:2: \"nan\" is not finite";
  }
  SECTION("calibrations exchanged") {
    replace_text(sequence / "calib.txt", "P0:", "P2:");
    replace_text(sequence / "calib.txt", "P1:", "P0:");
    replace_text(sequence / "calib.txt", "P2:", "P1:");
    reason = "calib.txt: the baseline is not positive";
  }
  SECTION("truth not finite") {
    replace_text(data / "poses/00.txt", "1.0", "nan");
    reason = "00.txt:1: \"nan";
  }
  check_refused(run_slam(folder.path(), "data"), 3, reason);
  CHECK_FALSE(fs::exists(folder.path() / "out"));
}

TEST_CASE("a sequence or layout that is not there is refused with code 3") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data", 2);
  check_refused(run_slam(folder.path(), "data", {"--sequence", "01"}), 3,
                "data: no sequence \"01\"; there is: 00");
  check_refused(run_slam(folder.path(), "data", {"--layout", "euroc"}), 3,
                "data: no EuRoC sequence here");
}

TEST_CASE("a configuration that cannot be used is refused with file, line and key") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data", 2);
  const fs::path config = folder.path() / "options.yaml";
  std::string reason;
  SECTION("missing") { reason = "options.yaml: cannot be read"; }
  SECTION("a folder") {
    fs::create_directory(config);
    reason = "options.yaml: cannot be read";
  }
  SECTION("unknown key") {
    write_text(config, "features: 400\nfeature: 3\n");
    reason = "options.yaml:2: feature: unknown key";
  }
  SECTION("unknown key of a section") {
    write_text(config, "tracking:\n  keyframes:\n    min_inliers: 15\n    max_inliers: 3\n");
    reason = "options.yaml:4: tracking.keyframes.max_inliers: unknown key";
  }
  SECTION("a value of the wrong type") {
    write_text(config, "sift:\n  upsample: perhaps\n");
    reason = "options.yaml:2: sift.upsample: is none of auto, true, false";
  }
  SECTION("a word that is not among those to choose from") {
    write_text(config, "backend:\n  method: magic\n");
    reason = "options.yaml:2: backend.method: is none of incremental, bundle";
  }
  SECTION("a value out of range") {
    write_text(config, "features: 3\n");
    reason = "options.yaml: features must lie between 50 and 100000";
  }
  SECTION("a value that is not finite") {
    write_text(config, "tracking:\n  last_frame_radius: .nan\n");
    reason = "options.yaml:2: tracking.last_frame_radius: is not finite";
  }
  SECTION("a negative seed") {
    write_text(config, "seed: -1\n");
    reason = "options.yaml:1: seed: must be a whole number in range";
  }
  SECTION("a list for a section") {
    write_text(config, "\nsift: [1, 2]\n");
    reason = "options.yaml:2: sift: must hold keys and values";
  }
  SECTION("no keys at all") {
    write_text(config, "features 400\n");
    reason = "options.yaml:1: holds no keys and values";
  }
  SECTION("a key that is no word") {
    write_text(config, "[a, b]: 400\n");
    reason = "options.yaml:1: a key must be a word";
  }
  SECTION("not YAML") {
    write_text(config, "sift: {upsample: true\nfeatures: [\n");
    reason = "options.yaml:";
  }
  check_refused(run_program(HYBRID_SLAM, {"data", "--config", "options.yaml"}, folder.path()), 3,
                reason);
}

TEST_CASE("a vocabulary that cannot be used is refused before anything is done") {
  const TempFolder folder;
  const fs::path file = folder.path() / "words.voc";
  std::string numbers;
  for (int i = 0; i < 128; ++i) numbers += "0.1 ";
  std::string reason;
  SECTION("missing") { reason = "words.voc: "; }
  SECTION("garbage") {
    write_text(file, "no words\nat all\n");
    reason = "words.voc:1: ";
  }
  SECTION("cut off") {
    write_text(file, "HSLAMVOC12");
    reason = "words.voc: the file is cut off";
  }
  SECTION("a shorter descriptor") {
    write_text(file, "2 1 0 0\n0 1 0.5 0.5 1\n0 1 0.1 0.1 1\n");
    reason = "words.voc:2: too short for a node";
  }
  SECTION("plain SIFT") {
    write_text(file, "2 1 0 0\n0 1 " + numbers + "1\n0 1 " + numbers + "2\n");
    reason = "words.voc: a vocabulary of plain SIFT";
  }
  check_refused(run_program(HYBRID_SLAM, {"data", "--vocabulary", "words.voc"}, folder.path()), 3,
                reason);
  CHECK(!fs::exists(folder.path() / "out"));
}

TEST_CASE("bad usage is refused with one line and code 2") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data", 2);
  const auto refused = [&](const std::vector<std::string>& arguments, const std::string& reason) {
    std::string words;
    for (const std::string& argument : arguments) words += argument + " ";
    INFO(words);
    check_refused(run_program(HYBRID_SLAM, arguments, folder.path()), 2, reason);
  };
  refused({}, "DATASET is required");
  refused({"data", "more"}, "more");
  refused({"data", "--fast"}, "--fast");
  refused({"data", "--mode", "sometimes"}, "--mode: ");
  refused({"data", "--layout", "tum"}, "--layout: ");
  refused({"data", "--cameras", "mono"}, "--cameras: ");
  refused({"data", "--rate", "5"}, "--rate needs --mode realtime");
  refused({"data", "--rate", "5", "--mode", "every-frame"}, "--rate needs --mode realtime");
  refused({"data", "--mode", "realtime", "--rate", "0"}, "--rate: ");
  refused({"data", "--mode", "realtime", "--rate", "-2"}, "--rate: ");
  refused({"data", "--mode", "realtime", "--rate", "nan"}, "--rate: ");
  refused({"data", "--mode", "realtime", "--rate", "inf"}, "--rate: ");
  refused({"data", "--features", "10"}, "--features: ");
  refused({"data", "--features", "many"}, "--features");
  refused({"data", "--threads", "0"}, "--threads: ");
  refused({"data", "--device", "tpu"}, "--device: ");
  if (!why_no_cuda_sift({}).empty()) refused({"data", "--device", "cuda"}, "--device cuda: ");
  refused({"data", "--seed", "-1"}, "--seed");
  refused({"data", "--limit", "-3"}, "--limit");
  refused({"data", "--limit", "0"}, "--limit");
  refused({"data", "--out"}, "--out");
  refused({"data", "--out", ""}, "--out");
  CHECK_FALSE(fs::exists(folder.path() / "out"));
}

TEST_CASE("an output folder that cannot be written is refused before the run, with code 3") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  SECTION("it is a file") {
    write_text(folder.path() / "file", "mine");
    check_refused(run_slam(folder.path(), "data", {"--out", "file"}), 3, "file: ");
    check_refused(run_slam(folder.path(), "data", {"--out", "file/below"}), 3, "file/below: ");
    CHECK(read_text(folder.path() / "file") == "mine");
  }
  SECTION("it is not writable") {
    if (geteuid() == 0) {  // root may write everywhere but here
      check_refused(run_slam(folder.path(), "data", {"--out", "/proc/results"}), 3,
                    "/proc/results: ");
      return;
    }
    fs::create_directory(folder.path() / "locked");
    fs::permissions(folder.path() / "locked", fs::perms::owner_read | fs::perms::owner_exec);
    check_refused(run_slam(folder.path(), "data", {"--out", "locked"}), 3, "locked/");
    check_refused(run_slam(folder.path(), "data", {"--out", "locked/below"}), 3, "locked/below: ");
  }
}

TEST_CASE("images without features end in one line and code 4") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_kitti_survey(data);
  for (int i = 0; i < kSurveyFrames; ++i) {
    for (const bool right : {false, true}) {
      cv::imwrite(kitti_image(data, right, i).string(),
                  cv::Mat(240, 320, CV_8UC1, cv::Scalar(100)));
    }
  }
  for (const char* const mode : {"every-frame", "realtime"}) {
    const Outcome outcome = run_slam(folder.path(), "data", {"--quiet", "--mode", mode});
    INFO(outcome.err);
    CHECK(outcome.code == 4);
    CHECK(count_lines(outcome.err) == 1);
    CHECK(count_lines(outcome.err, "error: no frame could be tracked") == 1);
    const Json summary = read_json(folder.path() / "out/summary.json");
    CHECK(summary["frames"]["lost"] == kSurveyFrames);
    CHECK(summary["landmarks"] == 0);
    CHECK(summary["ate"].is_null());
  }
}

}  // namespace
}  // namespace hybrid_slam
