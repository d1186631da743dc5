#include <algorithm>
#include <cmath>
#include <map>
#include <sstream>

#include <fmt/format.h>
#include <catch2/catch.hpp>

#include "apps/feature_eval/methods/opencv_features.h"
#include "frontend/input/image_sequence.h"
#include "test/apps/feature_study/onnx_file.h"
#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

const std::string kHeader =
    "sequence,method,auc_rotation,auc_translation,mean_inliers,ms_per_image,ms_per_match";

Outcome run_study(const TempFolder& folder, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "study");
  return run_program(FEATURE_EVAL, arguments, folder.path());
}

std::vector<std::vector<std::string>> read_rows(const fs::path& path, const std::string& header) {
  std::istringstream file(read_text(path));
  std::string line;
  std::getline(file, line);
  CHECK(line.substr(0, header.size()) == header);
  std::vector<std::vector<std::string>> rows;
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(cell);
  }
  return rows;
}

void write_network(const TempFolder& folder) {
  write_text(folder.path() / "means.onnx", onnx_bytes(block_means(32, 32, 32, 4, 2)));
  write_text(folder.path() / "means.yaml",
             "model: means.onnx\nkind: patch_descriptor\nname: block_means\n"
             "input: {per_patch: true}\ndescriptor: {length: 128}\npatch: {batch: 32}\n");
}

// How often `part` stands in the text.
int occurrences(const std::string& text, const std::string& part) {
  int count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) {
    ++count;
  }
  return count;
}

TEST_CASE("feature_eval study writes the tables of a rendered survey") {
  const TempFolder folder;
  write_uwslam_survey(folder.path() / "data", false);
  write_network(folder);
  const Outcome outcome =
      run_study(folder, {"data", "data/hybrid/M1", "--methods",
                         "sift,rootsift,cv_sift,cv_rootsift,orb,akaze,kaze,brisk,onnx:means.yaml",
                         "--every", "5", "--features", "800", "--out", "a/b"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  const fs::path out = folder.path() / "a/b";
  CHECK(outcome.out == read_text(out / "study.txt"));
  for (const char* const file : {"study.csv", "study_bearings.csv"}) {
    const auto rows = read_rows(out / file, kHeader);
    REQUIRE(rows.size() == 18);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      INFO(file << " " << rows[i][1]);
      REQUIRE(rows[i].size() == 7);
      CHECK(rows[i][0] == (i < 9 ? "M1" : "M1_2"));
      for (const std::size_t column : {2U, 3U}) {
        CHECK(std::stod(rows[i][column]) >= 0);
        CHECK(std::stod(rows[i][column]) <= 1);
      }
      CHECK(std::stod(rows[i][5]) > 0);
      CHECK(std::stod(rows[i][6]) > 0);
      if (rows[i][1] != "sift" && rows[i][1] != "rootsift") continue;
      // Textured blocks in clear air: within a few degrees.
      CHECK(std::stod(rows[i][2]) > 0.97);
      CHECK(std::stod(rows[i][3]) > 0.95);
      CHECK(std::stod(rows[i][4]) > 40);
    }
    CHECK(rows[8][1] == "block_means");
  }
  CHECK(read_text(out / "study.csv").find(kHeader + "\n") == 0);
  const auto pairs = read_rows(out / "pairs.csv", "sequence,frame,method,left_keypoints,");
  REQUIRE(pairs.size() == 2 * 9 * 2);
  CHECK(pairs[1][1] == "5");
  for (const auto& row : pairs) CHECK(row.size() == 12);
  for (const bool bearings : {false, true}) {
    const auto rows = read_rows(out / (bearings ? "study_bearings.csv" : "study.csv"), kHeader);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      double figures[3] = {0, 0, 0};  // of this row, from its two pairs
      for (const std::size_t pair : {2 * i, 2 * i + 1}) {
        REQUIRE(pairs[pair][2] == rows[i][1]);
        const std::size_t first = bearings ? 9 : 6;
        figures[0] += (1 - std::stod(pairs[pair][first + 1]) / 180) / 2;
        figures[1] += (1 - std::stod(pairs[pair][first + 2]) / 180) / 2;
        figures[2] += std::stod(pairs[pair][first]) / 2;
      }
      CHECK(std::stod(rows[i][2]) == Approx(figures[0]).margin(1e-4));
      CHECK(std::stod(rows[i][3]) == Approx(figures[1]).margin(1e-4));
      CHECK(std::stod(rows[i][4]) == Approx(figures[2]).margin(0.06));
    }
  }
  const std::string latex = read_text(out / "study.tex");
  CHECK(occurrences(latex, "\\\\\n") == 2 + 9);
  CHECK(latex.find("cv\\_rootsift & ") != std::string::npos);
  CHECK(latex.find("M1\\_2") != std::string::npos);
}

TEST_CASE("the study's page needs nothing else and has a chart and a picture for all") {
  const TempFolder folder;
  write_uwslam_survey(folder.path() / "data", false);
  REQUIRE(run_study(folder, {"data", "--methods", "rootsift,orb"}).code == 0);
  const std::string page = read_text(folder.path() / "out/study.html");
  CHECK(page.size() < 400000);
  CHECK(page.find("http://") == std::string::npos);
  CHECK(page.find("https://") == std::string::npos);
  CHECK(page.find("<script") == std::string::npos);
  CHECK(page.find("default-src 'none'") != std::string::npos);
  CHECK(page.find("prefers-color-scheme: dark") != std::string::npos);
  CHECK(occurrences(page, "data:image/jpeg;base64,/9j/") == 2);  // each image once
  CHECK(occurrences(page, "href=\"#pair0\"") == 2);              // and shown by each method
  CHECK(occurrences(page, "<svg class=\"chart\"") == 1 + 2 * 2);
  CHECK(occurrences(page, "<table>") == 2);
  CHECK(occurrences(page, "<svg") == occurrences(page, "</svg>"));
  CHECK(occurrences(page, "<path class=\"in\"") > 20);
}

TEST_CASE("a study comes to the same figures again, times aside") {
  const TempFolder folder;
  write_uwslam_survey(folder.path() / "data", false);
  for (const char* const out : {"one", "two"}) {
    REQUIRE(run_study(folder, {"data", "--methods", "rootsift,akaze", "--out", out}).code == 0);
  }
  CHECK(read_text(folder.path() / "one/pairs.csv") == read_text(folder.path() / "two/pairs.csv"));
}

TEST_CASE("a study with masks has no features on tags") {
  const TempFolder folder;
  write_uwslam_survey(folder.path() / "data", false);
  const auto keypoints = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"data",  "--methods", "rootsift", "--features",
                                       "20000", "--out",     out};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run_study(folder, arguments);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    return std::stod(read_rows(folder.path() / out / "pairs.csv", "sequence").front()[3]);
  };
  const double all = keypoints("all", {});
  CHECK(keypoints("none", {"--masks"}) == all);
  const auto sequence = open_sequence((folder.path() / "data").string(), SequenceLayout::kAuto, "");
  const Eigen::Vector3d ahead =
      sequence->info().truth.front().world_from_cam * Eigen::Vector3d(0, 0, 2);
  write_text(folder.path() / "data/hybrid/M1/tags.txt",
             fmt::format("0 0.8 {} {} {}\n", ahead.x(), ahead.y(), ahead.z()));
  CHECK(keypoints("tags", {"--masks"}) < 0.9 * all);
  CHECK(keypoints("plain", {}) == all);
}

TEST_CASE("a method that OpenCV lacks is named in one line, and the others are studied") {
  if (why_no_opencv_features("surf").empty()) return;
  const TempFolder folder;
  write_uwslam_survey(folder.path() / "data", false);
  const Outcome outcome = run_study(folder, {"data", "--methods", "surf,orb"});
  CHECK(outcome.code == 0);
  CHECK(count_lines(outcome.err, "surf: missing: OpenCV was built without") == 1);
  CHECK(count_lines(outcome.out, "surf: missing: OpenCV was built without") == 1);
  CHECK(read_rows(folder.path() / "out/study.csv", kHeader).size() == 1);
}

TEST_CASE("a study refuses with one line and a documented code what it cannot use") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_uwslam_survey(data, false);
  write_kitti_survey(folder.path() / "kitti");
  write_network(folder);
  write_text(folder.path() / "file", "no folder");
  write_text(folder.path() / "text.onnx", "no network");
  write_text(folder.path() / "text.yaml",
             "model: text.onnx\nkind: patch_descriptor\ndescriptor: {length: 128}\n");
  write_text(folder.path() / "short.yaml",
             "model: means.onnx\nkind: patch_descriptor\ndescriptor: {length: 64}\n"
             "patch: {batch: 32}\n");
  const auto refused = [&](const std::vector<std::string>& arguments, int code,
                           const std::string& reason) {
    INFO(reason);
    check_refused(run_study(folder, arguments), code, reason, "feature_eval");
  };
  refused({}, 2, "DATASET");
  refused({"data", "--methods", "sift,sirf"}, 2, "no method \"sirf\"");
  refused({"data", "--methods", ""}, 2, "no method \"\"");
  refused({"data", "--methods", "orb,sift,orb"}, 2, "orb stands there twice");
  refused({"data", "--every", "0"}, 2, "--every");
  refused({"data", "--features", "0"}, 2, "--features");
  refused({"data", "--threshold", "-1"}, 2, "--threshold");
  refused({"data", "--out", ""}, 2, "--out");
  if (!why_no_opencv_features("surf").empty()) {
    refused({"data", "--methods", "surf"}, 2, "OpenCV was built without");
  }
  refused({"none"}, 3, "none");
  refused({"kitti"}, 3, "kitti: has no fisheye");
  refused({"data", "--methods", "onnx:none.yaml"}, 3, "none.yaml: cannot be read");
  refused({"data", "--methods", "onnx:text.yaml"}, 3, "text.onnx: not an ONNX file");
  refused({"data", "--methods", "onnx:short.yaml"}, 3, "means.onnx: gives 32x128");
  CHECK_FALSE(fs::exists(folder.path() / "out"));
  refused({"data", "--out", "file"}, 3, "file");
  refused({"data", "--out", "file/below"}, 3, "file");
  fs::remove(data / "hybrid/M1/camera_poses.txt");
  refused({"data"}, 3, "has no true poses of both cameras");
}

TEST_CASE("a damaged image costs a study its own pair") {
  const TempFolder folder;
  const fs::path data = folder.path() / "data";
  write_uwslam_survey(data, false);
  fs::resize_file(data / "hybrid/M1/images/raw/5_fish.png", 100);
  const Outcome outcome = run_study(folder, {"data", "--methods", "orb"});
  CHECK(outcome.code == 0);
  CHECK(count_lines(outcome.err, "M1: frame 5 is left out: ") == 1);
  CHECK(read_rows(folder.path() / "out/pairs.csv", "sequence").size() == 1);
}

TEST_CASE("the study's help names options, results and exit codes") {
  const TempFolder folder;
  const Outcome outcome = run_study(folder, {"--help"});
  CHECK(outcome.code == 0);
  for (const char* const word :
       {"DATASET", "--methods", "--features", "--every", "--threshold", "--masks", "--out",
        "auc_translation", "onnx:FILE.yaml", "study.html", "Exit codes"}) {
    INFO(word);
    CHECK(outcome.out.find(word) != std::string::npos);
  }
}

}  // namespace
}  // namespace hybrid_slam
