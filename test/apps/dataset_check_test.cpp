#include "apps/dataset_check/pair_survey.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <catch2/catch.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "frontend/matching/pair_check.h"
#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

struct Checked {
  Outcome outcome;
  Json json;
};

Checked check(const fs::path& folder, const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments{"check",   "data",   "--features", "400",
                                     "--quiet", "--json", "check.json"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  Checked result{run_program(HYBRID_SLAM, arguments, folder), {}};
  INFO(result.outcome.err);
  REQUIRE(fs::exists(folder / "check.json"));
  result.json = read_json(folder / "check.json");
  return result;
}

std::vector<std::string> findings(const Json& json) {
  std::vector<std::string> names;
  for (const Json& finding : json["findings"]) names.push_back(finding["name"]);
  return names;
}

using Names = std::vector<std::string>;

// Moves the right images' pixels: (x, y) to change * (x, y, 1).
void warp_right_images(const fs::path& data, const cv::Mat& change) {
  for (int i = 0; i < kSurveyFrames; ++i) {
    const std::string path = kitti_image(data, true, i).string();
    const cv::Mat image = cv::imread(path, cv::IMREAD_GRAYSCALE);
    cv::Mat warped;
    cv::warpAffine(image, warped, change, image.size(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
    REQUIRE(cv::imwrite(path, warped));
  }
}

double offset_in(const Json& json, int column, int row) {
  return json["rows"]["regions"][static_cast<std::size_t>(row)][static_cast<std::size_t>(column)]
             ["offset_px"];
}

}  // namespace

TEST_CASE("What matches say of a pair: medians by region, disparities") {
  PairSurvey survey(300, 300);
  std::vector<PairMatch> matches;
  for (int i = 0; i < 99; ++i) {
    const float x = static_cast<float>(i % 3) * 100 + 50;
    const float y = static_cast<float>(i / 3 % 3) * 100 + 50;
    // Rows are off by the region's column; disparities from 1 to 99.
    matches.push_back({x, y, static_cast<float>(i % 3) - 1, static_cast<float>(i + 1), 1});
  }
  matches.push_back({50, 50, 40, 7, PairCheck::kSmall + 1});  // coarse: nothing for the rows
  survey.add(matches);
  CHECK(survey.matches() == 100);
  CHECK(survey.rows().matches == 99);
  CHECK(survey.rows().offset == 0);
  CHECK(survey.rows().error == 1);
  CHECK(survey.rows_in(0, 1).offset == -1);
  CHECK(survey.rows_in(1, 1).error == 0);
  CHECK(survey.rows_in(2, 0).offset == 1);
  CHECK(survey.rows_in(2, 2).matches == 11);
  CHECK(survey.disparity(50) == 50);
  CHECK(survey.disparity(100) == 99);
  CHECK(survey.disparity(1) == 1);
  CHECK(survey.reversed() == 0);
  for (PairMatch& match : matches) match.disparity = -match.disparity;
  PairSurvey swapped(300, 300);
  swapped.add(matches);
  CHECK(swapped.reversed() == Approx(98.0 / 99));  // a disparity of -1 is within the noise
  CHECK(PairSurvey(10, 10).disparity(50) == 0);
  CHECK(PairSurvey(10, 10).rows().matches == 0);
}

TEST_CASE("check: a good dataset, and its numbers") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  const Checked checked = check(folder.path());
  INFO(checked.json.dump(1));
  CHECK(checked.outcome.code == 0);
  CHECK(findings(checked.json).empty());
  CHECK(checked.json["pairs"] == kSurveyFrames);
  CHECK(checked.json["baseline_m"] == 0.12);
  CHECK(checked.json["times"]["period_s"].get<double>() == Approx(kSurveyPeriod));
  CHECK(checked.json["times"]["duration_s"].get<double>() ==
        Approx(kSurveyPeriod * (kSurveyFrames - 1)));
  CHECK(checked.json["rows"]["error_px"].get<double>() < 0.4);
  CHECK(checked.json["rows"]["matches"].get<int>() > 500);
  CHECK(checked.json["unreadable"].empty());
  CHECK(checked.json["gaps"].empty());
  CHECK(checked.json["stereo"]["images"] == kSurveyFrames);
  CHECK(checked.json["stereo"]["sampled"] == kSurveyFrames);
  // The ground is some metres away: f b / d.
  const Json& median = checked.json["distances"]["median"];
  CHECK(median["distance_m"].get<double>() ==
        Approx(260 * 0.12 / median["disparity_px"].get<double>()));
  CHECK(count_lines(checked.outcome.out, "nothing that speaks against it") == 1);
  CHECK(count_lines(checked.outcome.out, "baseline 0.12 m") == 1);
  CHECK(check(folder.path(), {"--pairs", "3"}).json["stereo"]["sampled"] == 3);
  CHECK(check(folder.path(), {"--start", "2", "--limit", "4"}).json["pairs"] == 4);
}

TEST_CASE("check: left and right exchanged") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_kitti_survey(data);
  fs::rename(data / "sequences/00/image_0", data / "sequences/00/image");
  fs::rename(data / "sequences/00/image_1", data / "sequences/00/image_0");
  fs::rename(data / "sequences/00/image", data / "sequences/00/image_1");
  const Checked checked = check(folder.path());
  CHECK(checked.outcome.code == 5);
  CHECK(findings(checked.json) == Names{"swapped"});
  CHECK(checked.json["reversed"].get<double>() > 0.9);
  CHECK(count_lines(checked.outcome.out, "left and right are swapped") == 1);
}

TEST_CASE("check: rows that do not agree, and where") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_kitti_survey(data);
  SECTION("the right images stand 3 px lower") {
    warp_right_images(data, (cv::Mat_<double>(2, 3) << 1, 0, 0, 0, 1, 3));
    const Checked checked = check(folder.path());
    INFO(checked.json.dump(1));
    CHECK(checked.outcome.code == 5);
    CHECK(findings(checked.json).front() == "rows");
    CHECK(checked.json["rows"]["offset_px"].get<double>() == Approx(-3).margin(0.2));
    CHECK(checked.json["rows"]["error_px"].get<double>() == Approx(3).margin(0.2));
    CHECK(offset_in(checked.json, 1, 1) == Approx(-3).margin(0.3));
  }
  SECTION("the right camera is rolled by 1.2 degrees") {
    warp_right_images(data, cv::getRotationMatrix2D({159.5F, 119.5F}, 1.2, 1));
    const Checked checked = check(folder.path());
    INFO(checked.json.dump(1));
    CHECK(checked.outcome.code == 5);
    CHECK(findings(checked.json).front() == "rows");
    // A sixth of the image from its sides: 107 px from the middle, less the disparity's share.
    const double left = offset_in(checked.json, 0, 1), right = offset_in(checked.json, 2, 1);
    CHECK(std::abs(left) == Approx(107 * std::sin(1.2 * M_PI / 180)).margin(0.8));
    CHECK(std::abs(right) == Approx(107 * std::sin(1.2 * M_PI / 180)).margin(0.8));
    CHECK(left * right < 0);
  }
}

TEST_CASE("check: gaps, black and damaged images, units") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_kitti_survey(data, 12);
  std::string times;
  for (int i = 0; i < 12; ++i) times += std::to_string(0.2 * i + (i >= 8 ? 3 : 0)) + "\n";
  write_text(data / "sequences/00/times.txt", times);
  write_text(kitti_image(data, true, 5), "no image");
  for (int i = 1; i < 4; ++i) {
    cv::imwrite(kitti_image(data, false, i).string(), cv::Mat(240, 320, CV_8UC1, cv::Scalar(3)));
  }
  const Checked checked = check(folder.path());
  INFO(checked.json.dump(1));
  CHECK(checked.outcome.code == 5);
  CHECK(findings(checked.json) == Names{"unreadable", "gaps", "dark", "few_features"});
  REQUIRE(checked.json["unreadable"].size() == 1);
  CHECK(checked.json["unreadable"][0]["frame"] == 5);
  REQUIRE(checked.json["gaps"].size() == 1);
  CHECK(checked.json["gaps"][0]["frame"] == 8);
  CHECK(checked.json["gaps"][0]["seconds"].get<double>() == Approx(3.2));
  CHECK(checked.json["stereo"]["causes"]["dark"] == 3);
  CHECK(count_lines(checked.outcome.out, "000005.png: ") >= 1);

  // Millimetres.
  write_text(data / "sequences/00/calib.txt",
             "P0: 260 0 159.5 0 0 260 119.5 0 0 0 1 0\n"
             "P1: 260 0 159.5 -31200 0 260 119.5 0 0 0 1 0\n");
  const Names found = findings(check(folder.path()).json);
  CHECK(std::count(found.begin(), found.end(), "units") == 1);
}

TEST_CASE("check: of colour images the channel that is asked for is read") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data");
  const double brightness = check(folder.path()).json["stereo"]["brightness"];
  for (int i = 0; i < kSurveyFrames; ++i) {
    for (const bool right : {false, true}) {
      const std::string path = kitti_image(folder.path() / "data", right, i).string();
      const cv::Mat grey = cv::imread(path, cv::IMREAD_GRAYSCALE);
      const std::array<cv::Mat, 3> blue_green_red{grey / 2, grey, grey / 32};
      cv::Mat colour;
      cv::merge(blue_green_red.data(), 3, colour);
      REQUIRE(cv::imwrite(path, colour));
    }
  }
  const Checked green = check(folder.path(), {"--channel", "green"});
  CHECK(green.json["stereo"]["brightness"] == brightness);
  CHECK(findings(green.json).empty());
  const Checked blue = check(folder.path(), {"--channel", "blue"});
  CHECK(blue.json["stereo"]["brightness"].get<double>() == Approx(brightness / 2).margin(1));
  const Names dead = findings(check(folder.path(), {"--channel", "red"}).json);
  CHECK(std::count(dead.begin(), dead.end(), "dark") == 1);
}

TEST_CASE("check: with a fisheye") {
  const TempFolder folder;
  write_uwslam_survey(folder.path() / "data", false);
  fs::remove(folder.path() / "data/hybrid/M1/images/raw/3_fish.png");
  const Checked checked = check(folder.path());
  INFO(checked.json.dump(1));
  CHECK(checked.outcome.code == 0);
  CHECK(checked.json["fisheye"]["images"] == kSurveyFrames - 1);
  CHECK(checked.json["fisheye"]["missing"] == 1);
  CHECK(checked.json["fisheye"]["features"].get<double>() > 40);
  REQUIRE(checked.json["missing"].size() == 1);
  CHECK(checked.json["missing"][0] == "fisheye images of 1 frames");
}

TEST_CASE("check: what cannot be read or asked for") {
  const TempFolder folder;
  write_kitti_survey(folder.path() / "data", 2);
  const auto refused = [&](const std::vector<std::string>& arguments, int code,
                           const std::string& reason) {
    check_refused(run_program(HYBRID_SLAM, arguments, folder.path()), code, reason, "hybrid_slam");
  };
  refused({"check"}, 2, "DATASET is required");
  refused({"check", "data", "--pairs", "0"}, 2, "--pairs: ");
  refused({"check", "nowhere"}, 3, "nowhere: no such folder");
  refused({"check", "data", "--start", "2"}, 3, "00: has 2 frames; there is no frame 2");
}

}  // namespace hybrid_slam
