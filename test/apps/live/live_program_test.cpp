#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <csignal>
#include <string_view>
#include <thread>

#include "test/apps/program_run.h"
#include "test/apps/rendered_survey.h"
#include "test/support/temp_folder.h"

// hybrid_slam live, as its user sees it.
namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr std::int64_t kStart = 1'700'000'000'000'000'000;

std::string stamp_name(int frame) { return fmt::format("{}.png", kStart + frame * 200'000'001LL); }

// The survey as a recorder writes it, image by image.
class Recorder {
 public:
  explicit Recorder(const fs::path& root) : root_(root) {
    write_uwslam_survey(root / "data", false);
    for (const char* const camera : {"left", "right", "fisheye"}) {
      fs::create_directories(root / "dive" / camera);
    }
  }

  void write(int frame) const {
    const fs::path raw = root_ / "data/hybrid/M1/images/raw";
    for (const char* const camera : {"left", "right", "fisheye"}) {
      const fs::path folder = root_ / "dive" / camera;
      const std::string suffix = std::string(camera).substr(0, *camera == 'f' ? 4 : 5);
      fs::copy_file(raw / fmt::format("{}_{}.png", frame, suffix), folder / "coming.tmp");
      fs::rename(folder / "coming.tmp", folder / stamp_name(frame));
    }
  }
  void write_all(std::chrono::milliseconds pause = 0ms) const {
    for (int i = 0; i < kSurveyFrames; ++i) {
      write(i);
      std::this_thread::sleep_for(pause);
    }
  }

 private:
  fs::path root_;
};

const std::vector<std::string> kCalibration{
    "--calibration", "data/hybrid/calibration/left_camera.yaml",
    "data/hybrid/calibration/right_camera.yaml", "data/hybrid/calibration/fisheye_calib.yaml"};

std::vector<std::string> live(std::vector<std::string> arguments,
                              const std::vector<std::string>& more = {}) {
  arguments.insert(arguments.begin(), "live");
  arguments.insert(arguments.end(), kCalibration.begin(), kCalibration.end());
  for (const char* const option : {"--features", "400", "--quiet"}) arguments.emplace_back(option);
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

// The command that the program says to replay its recording by, given to a shell with more options.
Outcome replay_as_said(const std::string& text, const std::string& more, const fs::path& folder) {
  constexpr std::string_view kBefore = "replay it by: hybrid_slam ";
  const std::size_t found = text.find(kBefore);
  REQUIRE(found != std::string::npos);
  const std::size_t begin = found + kBefore.size();
  const std::string arguments = text.substr(begin, text.find('\n', begin) - begin);
  return run_program("/bin/sh", {"-c", fmt::format("{} {} {}", HYBRID_SLAM, arguments, more)},
                     folder);
}

const std::vector<std::string> kSameFiles{"stereo.tum", "stereo_online.tum", "fisheye.tum",
                                          "frames.csv", "map.hslam",         "map.ply"};

}  // namespace

TEST_CASE("live: a folder that grows, recorded and replayed to the same bytes") {
  const TempFolder folder;
  const Recorder recorder(folder.path());
  std::thread writing([&] { recorder.write_all(50ms); });
  const Outcome run = run_program(
      HYBRID_SLAM,
      live({"--watch", "dive", "--mode", "every-frame", "--record", "it's kept", "--limit", "8"}),
      folder.path());
  writing.join();
  INFO(run.err);
  REQUIRE(run.code == 0);
  const nlohmann::json summary = read_json(folder.path() / "out/summary.json");
  CHECK(summary["frames"]["tracked"] == kSurveyFrames);
  CHECK(summary["fisheye"]["frames"]["registered"] == kSurveyFrames);
  CHECK(summary["layout"] == "live");
  CHECK(summary["live"]["sets"] == kSurveyFrames);
  CHECK(summary["live"]["recorded"] == kSurveyFrames);
  CHECK(fs::exists(folder.path() / "out/report.html"));
  for (const char* const out : {"a", "b"}) {
    const Outcome replay =
        replay_as_said(run.out, std::string("--quiet --out ") + out, folder.path());
    INFO(replay.err);
    REQUIRE(replay.code == 0);
    for (const std::string& file : kSameFiles) {
      INFO(file);
      const bool same =
          read_text(folder.path() / "out" / file) == read_text(folder.path() / out / file);
      CHECK(same);
    }
    CHECK(read_json(folder.path() / out / "summary.json")["images_xxh3"] == summary["images_xxh3"]);
  }
}

TEST_CASE("live: Ctrl-C saves what there is") {
  const TempFolder folder;
  const Recorder recorder(folder.path());
  recorder.write_all();
  ChildProcess child(HYBRID_SLAM, live({"--watch", "dive", "--timeout", "1"}), folder.path());
  REQUIRE(child.wait_for_error_text("no new images", 60s));
  child.send(SIGTERM);
  const Outcome run = child.finish(60s);
  INFO(run.err);
  CHECK(run.code == 0);
  CHECK(count_lines(run.err, "no new images") == 1);
  const nlohmann::json summary = read_json(folder.path() / "out/summary.json");
  CHECK(summary["frames"]["read"].get<int>() + summary["frames"]["dropped"].get<int>() ==
        kSurveyFrames);
  CHECK(summary["frames"]["tracked"].get<int>() > 2);
  CHECK(fs::exists(folder.path() / "out/map.hslam"));
  CHECK(fs::exists(folder.path() / "out/report.html"));
}

TEST_CASE("live: a recording that cannot go on ends by itself") {
  const TempFolder folder;
  const Recorder recorder(folder.path());
  ChildProcess child(
      HYBRID_SLAM,
      live({"--watch", "dive", "--mode", "every-frame", "--record", "kept", "--limit", "8"}),
      folder.path());
  for (int i = 0; i < kSurveyFrames; ++i) {
    recorder.write(i);
    if (i != 3) continue;
    while (!fs::exists(folder.path() / "kept/left" / stamp_name(3)))
      std::this_thread::sleep_for(20ms);
    fs::rename(folder.path() / "kept/right", folder.path() / "kept/gone");
  }
  const Outcome run = child.finish(60s);
  INFO(run.err);
  CHECK(run.code == 6);
  CHECK(count_lines(run.err, "the recording ends with 4 sets, and the run goes on") == 1);
  const nlohmann::json summary = read_json(folder.path() / "out/summary.json");
  CHECK(summary["frames"]["tracked"] == kSurveyFrames);
  CHECK(summary["live"]["recorded"] == 4);
  CHECK(summary["live"]["recording_complete"] == false);
}

TEST_CASE("live: what cannot be used ends in one line") {
  const TempFolder folder;
  const Recorder recorder(folder.path());
  const auto refused = [&](const std::vector<std::string>& arguments, int code,
                           const std::string& reason) {
    check_refused(run_program(HYBRID_SLAM, live(arguments), folder.path()), code, reason);
  };
  // Whichever is found missing first.
  refused({"--left", "77", "--right", "78"}, 3, ": no such camera; this machine has");
  refused({"--left", "a.mp4", "--right", "b.mp4"}, 3, ".mp4: no such video");
  refused(
      {"--left", "udp://127.0.0.1:39871", "--right", "udp://127.0.0.1:39872", "--timeout", "0.5"},
      3, "delivers nothing: no image in 0.5 s");
  refused({"--left", "rtsp://127.0.0.1:39873/x", "--split", "--timeout", "0.5"}, 3,
          "rtsp://127.0.0.1:39873/x: the left camera delivers nothing");
  refused({"--left", "videotestsrc num-buffers=0 ! appsink", "--split", "--timeout", "0.5"}, 3,
          "appsink: the left camera delivers nothing");
  refused({"--watch", "nowhere"}, 3, "nowhere: no such folder");
  refused({"--watch", "dive", "--timeout", "0.5"}, 3, "no image of the left camera came in 0.5 s");
  fs::create_directories(folder.path() / "kept/left/old");
  refused({"--left", "udp://127.0.0.1:39871", "--split", "--record", "kept"}, 3,
          "kept/left: holds something already");
  check_refused(run_program(HYBRID_SLAM,
                            {"live", "--left", "udp://127.0.0.1:39871", "--split", "--calibration",
                             "nowhere.yaml"},
                            folder.path()),
                3, "nowhere.yaml: ");
  refused({"--left", "0"}, 2, "--left needs --right, or --split");
  refused({"--left", "0", "--right", "1", "--split"}, 2, "--split and --right");
  refused({}, 2, "--left is required, or --watch");
  recorder.write_all();
  fs::create_directories(folder.path() / "dive/late");  // by a clock that is 7.1 s ahead
  for (int i = 0; i < kSurveyFrames; ++i) {
    fs::copy_file(folder.path() / "dive/right" / stamp_name(i),
                  folder.path() / "dive/late" /
                      fmt::format("{}.png", kStart + 7'100'000'000LL + i * 200'000'001LL));
  }
  refused({"--watch", "dive", "--right", "late", "--timeout", "1"}, 3,
          "dive/left: left and right have no times in common: the least difference is 5.7e+03 ms");
  refused({"--watch", "dive", "--right", "fisheye"}, 3, "right camera: calibrated for 320x240");
  fs::remove_all(folder.path() / "dive/left");
  fs::copy(folder.path() / "dive/fisheye", folder.path() / "dive/left");
  refused({"--watch", "dive"}, 3, "320x240");
}

}  // namespace hybrid_slam
