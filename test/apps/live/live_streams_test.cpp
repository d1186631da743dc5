#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <csignal>
#include <sstream>
#include <thread>

#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

// Videos and real streams, sent by ffmpeg (Debian's package ffmpeg) over the loopback.
namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr const char* kFfmpeg = "/usr/bin/ffmpeg";
constexpr int kFrames = 70;  // five times there and back: they can be repeated without a jump

bool have_ffmpeg() {
  if (fs::exists(kFfmpeg)) return true;
  WARN("SKIPPED: needs ffmpeg");
  return false;
}

// Left and right of the survey, there and back at 5 Hz, as lossless videos.
void write_videos(const fs::path& root) {
  write_kitti_survey(root / "data", kFrames);
  for (const bool right : {false, true}) {
    const std::string images = kitti_image(root / "data", right, 0).parent_path().string();
    const Outcome made =
        run_program(kFfmpeg,
                    {"-v", "error", "-framerate", "5", "-i", images + "/%06d.png", "-c:v",
                     "libx264", "-qp", "0", "-bf", "0", "-g", "5", "-preset", "ultrafast",
                     "-pix_fmt", "gray", right ? "right.ts" : "left.ts"},
                    root);
    INFO(made.err);
    REQUIRE(made.code == 0);
  }
}

const std::vector<std::string> kRest{"--calibration", "data/sequences/00/calib.txt", "--features",
                                     "400"};

std::vector<std::string> live_videos(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), "live");
  arguments.insert(arguments.end(), kRest.begin(), kRest.end());
  return arguments;
}

// Both cameras' streams at the pace of the videos, again and again.
std::unique_ptr<ChildProcess> send(const fs::path& folder, int port) {
  std::vector<std::string> arguments{"-v", "error"};
  for (const char* const side : {"left", "right"}) {
    for (const char* const part : {"-re", "-stream_loop", "-1", "-i"}) arguments.emplace_back(part);
    arguments.push_back((folder / fmt::format("{}.ts", side)).string());
  }
  for (int side = 0; side < 2; ++side) {
    for (const std::string& part :
         {std::string("-map"), fmt::format("{}:v", side), std::string("-c"), std::string("copy"),
          std::string("-f"), std::string("mpegts"),
          fmt::format("udp://127.0.0.1:{}?pkt_size=1316", port + side)}) {
      arguments.push_back(part);
    }
  }
  fs::create_directories(folder / "sender");  // what it prints is its own
  return std::make_unique<ChildProcess>(kFfmpeg, arguments, folder / "sender");
}

}  // namespace

TEST_CASE("live: videos give the same poses as their images") {
  if (!have_ffmpeg()) return;
  const TempFolder folder;
  write_videos(folder.path());
  const Outcome images = run_program(
      HYBRID_SLAM, {"data", "--features", "400", "--quiet", "--limit", "12", "--out", "images"},
      folder.path());
  REQUIRE(images.code == 0);
  const Outcome run = run_program(HYBRID_SLAM,
                                  live_videos({"--left", "left.ts", "--right", "right.ts", "--mode",
                                               "every-frame", "--limit", "12"}),
                                  folder.path());
  INFO(run.err);
  REQUIRE(run.code == 0);
  const auto poses = [](const fs::path& file) {  // without their times
    std::istringstream lines(read_text(file));
    std::vector<std::vector<double>> rows;
    for (std::string line; std::getline(lines, line);) {
      if (line.starts_with('#')) continue;
      std::istringstream numbers(line);
      std::vector<double> pose(8);
      for (double& number : pose) numbers >> number;
      rows.emplace_back(pose.begin() + 1, pose.end());
    }
    return rows;
  };
  const auto expected = poses(folder.path() / "images/stereo.tum");
  const auto found = poses(folder.path() / "out/stereo.tum");
  REQUIRE(expected.size() == 12);
  REQUIRE(found.size() == 12);
  for (std::size_t i = 0; i < 12; ++i) {
    for (std::size_t k = 0; k < 7; ++k) CHECK(found[i][k] == Approx(expected[i][k]).margin(2e-4));
  }
}

TEST_CASE("live: two streams over UDP, cut and back, recorded and replayed", "[slow]") {
  if (!have_ffmpeg()) return;
  const TempFolder folder;
  write_videos(folder.path());
  constexpr int kPort = 39880;
  ChildProcess slam(HYBRID_SLAM,
                    live_videos({"--left", fmt::format("udp://127.0.0.1:{}", kPort), "--right",
                                 fmt::format("udp://127.0.0.1:{}", kPort + 1), "--mode",
                                 "every-frame", "--record", "kept", "--timeout", "60"}),
                    folder.path());
  std::this_thread::sleep_for(1s);
  auto sender = send(folder.path(), kPort);
  REQUIRE(slam.wait_for_error_text("after left's, give or take", 90s));
  std::this_thread::sleep_for(4s);
  sender.reset();  // cut
  std::this_thread::sleep_for(5s);
  sender = send(folder.path(), kPort);
  REQUIRE(slam.wait_for_error_text("camera is back after", 90s));
  std::this_thread::sleep_for(4s);
  slam.send(SIGINT);
  const Outcome run = slam.finish(60s);
  INFO(run.err);
  REQUIRE(run.code == 0);
  CHECK(count_lines(run.err, "the left camera is lost") == 1);
  CHECK(count_lines(run.err, "the right camera is lost") == 1);
  const nlohmann::json summary = read_json(folder.path() / "out/summary.json");
  CHECK(summary["frames"]["lost"] == 0);
  CHECK(summary["frames"]["tracked"] == summary["live"]["sets"]);
  CHECK(summary["live"]["sets"] == summary["live"]["recorded"]);
  CHECK(summary["frames"]["tracked"].get<int>() > 20);
  const Outcome replay = run_program(
      HYBRID_SLAM,
      {"--left", "kept/left", "--right", "kept/right", "--calibration",
       "kept/calibration/0_calib.txt", "--features", "400", "--quiet", "--out", "replayed"},
      folder.path());
  INFO(replay.err);
  REQUIRE(replay.code == 0);
  for (const char* const file : {"stereo.tum", "frames.csv", "map.hslam"}) {
    INFO(file);
    const bool same =
        read_text(folder.path() / "out" / file) == read_text(folder.path() / "replayed" / file);
    CHECK(same);
  }
}

}  // namespace hybrid_slam
