#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <set>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "frontend/features/sift_device.h"
#include "test/apps/program_run.h"
#include "test/frontend/features/test_images.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// The table below the header of a CSV file.
std::vector<std::vector<double>> read_csv(const fs::path& path, const std::string& header) {
  std::istringstream file(read_text(path));
  std::string line;
  std::getline(file, line);
  CHECK(line == header);
  std::vector<std::vector<double>> rows;
  const auto columns = static_cast<std::size_t>(std::count(header.begin(), header.end(), ',')) + 1;
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    std::string cell;
    rows.emplace_back();
    while (std::getline(cells, cell, ',')) rows.back().push_back(std::stod(cell));
    REQUIRE(rows.back().size() == columns);
  }
  return rows;
}

std::vector<std::vector<double>> read_keypoints(const fs::path& path) {
  return read_csv(path, "x,y,scale,angle,response");
}

double smallest_scale(const fs::path& path) {
  double smallest = 1000;
  for (const auto& row : read_keypoints(path)) smallest = std::min(smallest, row[2]);
  return smallest;
}

void write_image(const fs::path& path, const GrayImage& image) {
  const cv::Mat pixels(image.height, image.width, CV_8UC1,
                       const_cast<std::uint8_t*>(image.pixels.data()));
  REQUIRE(cv::imwrite(path.string(), pixels));
}

// A part of an image.
GrayImage cut(const GrayImage& image, int left, int top, int width, int height) {
  return to_image(width, height, [&](double x, double y) {
    return image.row(static_cast<int>(y) + top)[static_cast<int>(x) + left];
  });
}

Outcome run_eval(const TempFolder& folder, const std::vector<std::string>& arguments) {
  return run_program(FEATURE_EVAL, arguments, folder.path());
}

void check_times(const Json& json) {
  double sum = 0;
  for (const auto& [stage, time] : json["stages"].items()) {
    CHECK(time.get<double>() >= 0);
    sum += time.get<double>();
  }
  CHECK(json["total_ms"].get<double>() > 0);
  CHECK(sum <= 1.001 * json["total_ms"].get<double>());
}

const std::vector<Blob> kBlobs = {{30.3, 40.6, 2.0}, {80.75, 35.2, 3.0}, {60.5, 90.1, 4.5}};

TEST_CASE("feature_eval extract finds blobs where they are, by every engine") {
  const TempFolder folder;
  write_image(folder.path() / "blobs.png", blob_image(120, 120, kBlobs, 100));
  for (const std::string engine : {"cpu", "opencv"}) {
    INFO(engine);
    const Outcome outcome = run_eval(folder, {"extract", "blobs.png", "--engine", engine, "--out",
                                              "a/b", "--json", "times.json"});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(outcome.err.empty());
    const auto rows = read_keypoints(folder.path() / "a/b/blobs_keypoints.csv");
    for (const Blob& blob : kBlobs) {
      CHECK(std::any_of(rows.begin(), rows.end(), [&](const auto& row) {
        return std::hypot(row[0] - blob.x, row[1] - blob.y) < 0.06 &&
               std::abs(row[2] / blob.sigma - 1) < 0.25 && row[4] > 10;
      }));
    }
    const Json json = read_json(folder.path() / "times.json");
    CHECK(json["engine"] == engine);
    CHECK(json["upsample"] == true);
    CHECK(json["features"] == 2000);
    CHECK(json["images"].size() == 1);
    CHECK(json["images"][0]["keypoints"] == rows.size());
    CHECK(json["stages"].size() >= 2);
    check_times(json);
    CHECK(count_lines(outcome.out, "blobs.png: 120x120, " + std::to_string(rows.size())) == 1);
  }
}

TEST_CASE("feature_eval draws a circle of three scales around each keypoint") {
  const TempFolder folder;
  write_image(folder.path() / "blobs.png", blob_image(120, 120, {kBlobs[2]}, 100));
  REQUIRE(run_eval(folder, {"extract", "blobs.png", "--features", "1"}).code == 0);
  const auto rows = read_keypoints(folder.path() / "out/blobs_keypoints.csv");
  REQUIRE(rows.size() == 1);
  const cv::Mat_<cv::Vec3b> picture =
      cv::imread((folder.path() / "out/blobs_keypoints.png").string());
  REQUIRE(picture.cols == 8 * 120);
  REQUIRE(picture.rows == 8 * 120);
  const auto is_colored = [&](double radius, double angle) {
    const auto pixel = [&](double value) {
      return static_cast<int>(std::lround((value + 0.5) * 8 - 0.5));
    };
    const cv::Vec3b color = picture(pixel(rows[0][1] + radius * std::sin(angle)),
                                    pixel(rows[0][0] + radius * std::cos(angle)));
    return std::max({color[0], color[1], color[2]}) - std::min({color[0], color[1], color[2]}) > 60;
  };
  const double radius = 3 * rows[0][2], angle = rows[0][3];
  for (double turn = 0; turn < 2 * std::numbers::pi; turn += 0.5) {
    CHECK(is_colored(radius, turn));
    CHECK_FALSE(is_colored(1.2 * radius, turn));
  }
  CHECK(is_colored(0.5 * radius, angle));
  CHECK_FALSE(is_colored(0.5 * radius, angle + 1));
}

TEST_CASE("feature_eval keeps what options ask for, whatever the threads") {
  const TempFolder folder;
  std::vector<std::string> arguments{"extract"};
  for (unsigned i = 0; i < 3; ++i) {
    const std::string name = "folder" + std::to_string(i) + "/image.png";
    fs::create_directories((folder.path() / name).parent_path());
    write_image(folder.path() / name, texture(200, 160, i));
    arguments.push_back(name);
  }
  const auto run_with = [&](const std::vector<std::string>& more) {
    std::vector<std::string> all = arguments;
    all.insert(all.end(), more.begin(), more.end());
    return run_eval(folder, all).code;
  };
  REQUIRE(run_with({"--out", "one", "--features", "50", "--repeat", "3"}) == 0);
  REQUIRE(run_with({"--out", "many", "--features", "50", "--threads", "3"}) == 0);
  REQUIRE(run_with({"--out", "plain", "--upsample", "off", "--json", "plain.json"}) == 0);
  REQUIRE(run_with({"--out", "upsampled", "--upsample", "on"}) == 0);
  for (const std::string name : {"image", "image_2", "image_3"}) {
    const std::string file = name + "_keypoints.csv";
    CHECK(read_keypoints(folder.path() / "one" / file).size() == 50);
    CHECK(read_text(folder.path() / "one" / file) == read_text(folder.path() / "many" / file));
    CHECK(smallest_scale(folder.path() / "plain" / file) > 1.5);  // 1.6 * 2^(1 / 3), and a fit
    CHECK(smallest_scale(folder.path() / "upsampled" / file) < 1.2);
  }
  CHECK(read_text(folder.path() / "one/image_keypoints.csv") !=
        read_text(folder.path() / "one/image_2_keypoints.csv"));
  const Json json = read_json(folder.path() / "plain.json");
  CHECK(json["upsample"] == false);
  CHECK(json["images"][2]["image"] == "folder2/image.png");
}

TEST_CASE("feature_eval match finds by how much images are shifted") {
  const TempFolder folder;
  const GrayImage image = texture(260, 220, 5);
  constexpr std::array<std::pair<int, int>, 2> kShifts = {{{7, 4}, {0, 12}}};
  write_image(folder.path() / "a.png", cut(image, 0, 0, 200, 180));
  write_image(folder.path() / "b.png", cut(image, kShifts[0].first, kShifts[0].second, 200, 180));
  write_image(folder.path() / "c.png", cut(image, kShifts[1].first, kShifts[1].second, 240, 200));
  const Outcome outcome = run_eval(
      folder, {"match", "a.png", "b.png", "c.png", "--json", "out.json", "--threads", "2"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const Json json = read_json(folder.path() / "out.json");
  CHECK(json["images"].size() == 3);
  REQUIRE(json["pairs"].size() == 2);
  check_times(json);
  const auto keypoints = json["images"][0]["keypoints"].get<std::size_t>();
  for (const std::size_t i : {0U, 1U}) {
    const std::string name = std::string("out/a_") + "bc"[i] + "_matches";
    const auto rows = read_csv(folder.path() / (name + ".csv"), "query,train,x1,y1,x2,y2,distance");
    CHECK(json["pairs"][i]["first"] == "a.png");
    CHECK(json["pairs"][i]["second"] == std::string(1, "bc"[i]) + ".png");
    CHECK(json["pairs"][i]["matches"] == rows.size());
    CHECK(2 * rows.size() > keypoints);
    const auto right = std::count_if(rows.begin(), rows.end(), [&](const auto& row) {
      CHECK(row[6] >= 0);
      CHECK(row[6] < 1.42);  // no number of a descriptor is negative
      return std::hypot(row[2] - row[4] - kShifts[i].first, row[3] - row[5] - kShifts[i].second) <
             0.5;
    });
    CHECK(static_cast<double>(right) > 0.97 * static_cast<double>(rows.size()));
    const cv::Mat picture = cv::imread((folder.path() / (name + ".png")).string());
    CHECK(picture.cols == (i == 0 ? 5 * 200 + 8 + 5 * 200 : 4 * 200 + 8 + 4 * 240));
    CHECK(picture.rows == (i == 0 ? 5 * 180 : 4 * 200));
  }
}

TEST_CASE("feature_eval match gives a feature to one other at most") {
  const TempFolder folder;
  const GrayImage image = texture(150, 120, 6);
  const GrayImage twice = to_image(300, 120, [&](double x, double y) {
    return image.row(static_cast<int>(y))[static_cast<int>(x) % 150];
  });
  write_image(folder.path() / "twice.png", twice);
  write_image(folder.path() / "once.png", image);
  REQUIRE(run_eval(folder, {"match", "twice.png", "once.png"}).code == 0);
  const auto rows =
      read_csv(folder.path() / "out/twice_once_matches.csv", "query,train,x1,y1,x2,y2,distance");
  CHECK(rows.size() > 100);
  std::set<double> used;
  for (const auto& row : rows) CHECK(used.insert(row[1]).second);
}

TEST_CASE("feature_eval refuses with one line and a documented code what it cannot use") {
  const TempFolder folder;
  write_image(folder.path() / "good.png", texture(40, 30, 1));
  write_text(folder.path() / "text.png", "no image");
  write_text(folder.path() / "empty.png", "");
  write_text(folder.path() / "cut.png", read_text(folder.path() / "good.png").substr(0, 300));
  fs::create_directories(folder.path() / "folder");
  const auto refused = [&](const std::vector<std::string>& arguments, int code,
                           const std::string& reason) {
    check_refused(run_eval(folder, arguments), code, reason, "feature_eval");
  };
  refused({}, 2, "subcommand");
  refused({"find", "good.png"}, 2, "");
  refused({"extract"}, 2, "IMAGE");
  refused({"match", "good.png"}, 2, "two images");
  refused({"extract", "good.png", "--features", "0"}, 2, "--features");
  refused({"extract", "good.png", "--features", "-3"}, 2, "--features");
  refused({"extract", "good.png", "--threads", "0"}, 2, "--threads");
  refused({"extract", "good.png", "--repeat", "0"}, 2, "--repeat");
  refused({"extract", "good.png", "--engine", "vlfeat"}, 2, "--engine");
  if (const std::string why = why_no_cuda_sift({}); !why.empty()) {
    refused({"extract", "good.png", "--engine", "cuda"}, 2, "--engine cuda: " + why);
  }
  refused({"extract", "good.png", "--upsample", "maybe"}, 2, "--upsample");
  refused({"extract", "good.png", "--out", ""}, 2, "--out");
  refused({"extract", "good.png", "none.png"}, 3, "none.png: no such image");
  refused({"match", "good.png", "text.png"}, 3, "text.png: neither PNG nor JPEG");
  refused({"extract", "empty.png"}, 3, "empty.png: empty image file");
  refused({"extract", "cut.png"}, 3, "cut.png: truncated PNG");
  refused({"extract", "folder"}, 3, "folder: is a folder");
  CHECK_FALSE(fs::exists(folder.path() / "out"));
  refused({"extract", "good.png", "--out", "text.png"}, 3, "text.png");
  refused({"extract", "good.png", "--json", "missing/x.json"}, 3, "missing/x.json");
}

TEST_CASE("feature_eval takes images without features") {
  const TempFolder folder;
  write_image(folder.path() / "tiny.png", texture(7, 3, 1));
  write_image(folder.path() / "flat.png", to_image(90, 70, [](double, double) { return 128; }));
  for (const std::string engine : {"cpu", "opencv"}) {
    const Outcome outcome =
        run_eval(folder, {"match", "tiny.png", "flat.png", "--engine", engine, "--json", "j.json"});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(read_json(folder.path() / "j.json")["pairs"][0]["matches"] == 0);
    CHECK(read_text(folder.path() / "out/tiny_flat_matches.csv") ==
          "query,train,x1,y1,x2,y2,distance\n");
  }
}

TEST_CASE("feature_eval's help names options, results and exit codes") {
  const TempFolder folder;
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"extract", "--help"}, {"match", "--help"}}) {
    const Outcome outcome = run_eval(folder, arguments);
    CHECK(outcome.code == 0);
    CHECK(outcome.err.empty());
    for (const char* const word :
         {"IMAGE", "--engine", "--upsample", "--features", "--threads", "--repeat", "--out",
          "--json", "x,y,scale,angle,response", "total_ms", "Exit codes"}) {
      INFO(word);
      CHECK(outcome.out.find(word) != std::string::npos);
    }
  }
}

}  // namespace
}  // namespace hybrid_slam
