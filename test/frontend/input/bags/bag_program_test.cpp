#include <cmath>
#include <cstdlib>
#include <iostream>
#include <optional>

#include <catch2/catch.hpp>

#include "frontend/input/image_sequence.h"
#include "test/frontend/input/bags/bag_writer.h"
#include "test/support/child_process.h"
#include "test/support/temp_folder.h"

// hybrid_slam on bags, as its user sees it.
namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;

constexpr int kPairs = 12;

std::optional<fs::path> kitti_sequence() {
  const char* const data = std::getenv("HYBRID_SLAM_DATA");
  if (data != nullptr && fs::is_directory(fs::path(data) / "kitti/sequences/s1")) {
    return fs::path(data) / "kitti/sequences/s1";
  }
  std::cout << "SKIPPED: HYBRID_SLAM_DATA has no kitti/sequences/s1\n";
  return std::nullopt;
}

Outcome run(const std::string& program, const std::vector<std::string>& arguments,
            const fs::path& folder) {
  return ChildProcess(program, arguments, folder).finish(std::chrono::seconds(1500));
}

// stereo.tum and map.hslam of a run over the first pairs.
struct Result {
  std::string path, map;
  bool operator==(const Result&) const = default;
};

Result slam(const fs::path& dataset, const fs::path& folder) {
  const Outcome outcome =
      run(HYBRID_SLAM,
          {dataset.string(), "--quiet", "--limit", std::to_string(kPairs), "--out", "out"}, folder);
  INFO(dataset << ": " << outcome.err);
  CHECK(outcome.err.empty());
  REQUIRE(outcome.code == 0);
  return {read_text(folder / "out/stereo.tum"), read_text(folder / "out/map.hslam")};
}

// P[3] that gives back the baseline to the last bit.
double offset_of(double fx, double baseline) {
  const double offset = -fx * baseline;
  for (const double near : {offset, std::nextafter(offset, 0.0), std::nextafter(offset, -1e9)}) {
    if (-near / fx == baseline) return near;
  }
  FAIL("no such number");
  return 0;
}

// The sequence's first pairs as messages, its rectified camera as CameraInfo.
std::vector<TestMessage> record(const ImageSequence& sequence, const Wire& wire) {
  const std::string infix = wire.serialization == Serialization::kRos1 ? "/" : "/msg/";
  const auto& stereo = sequence.info().stereo;
  const auto& [fx, fy, cx, cy, baseline] = stereo.params;
  std::vector<TestMessage> messages;
  for (std::size_t frame = 0; frame < kPairs; ++frame) {
    const FrameImages images = sequence.read(frame);
    const std::int64_t stamp = std::llround(images.time * 1e9);
    for (const bool right : {false, true}) {
      CameraInfoMessage info;
      info.width = static_cast<std::uint32_t>(stereo.width);
      info.height = static_cast<std::uint32_t>(stereo.height);
      info.k = {fx, 0, cx, 0, fy, cy, 0, 0, 1};
      info.r = {1, 0, 0, 0, 1, 0, 0, 0, 1};
      info.p = {fx, 0, cx, right ? offset_of(fx, baseline) : 0, 0, fy, cy, 0, 0, 0, 1, 0};
      const std::string place = right ? "/right" : "/left";
      messages.push_back({place + "/camera_info", "sensor_msgs" + infix + "CameraInfo",
                          camera_info_bytes(wire, stamp, info)});
      messages.push_back(
          {place + "/image_rect", "sensor_msgs" + infix + "Image",
           image_bytes(wire, {stamp, info.width, info.height, "mono8", false, info.width,
                              (right ? images.right : images.left).pixels})});
    }
  }
  return messages;
}

TEST_CASE("hybrid_slam writes the same bytes from a bag as from the images in folders") {
  const auto folders = kitti_sequence();
  if (!folders) return;
  const TempFolder folder;
  const auto sequence = open_sequence(folders->string(), SequenceLayout::kAuto, "");
  write_mcap(folder.path() / "s1.mcap", record(*sequence, {Serialization::kCdr, true}),
             {"lz4", 5, true});
  const Result expected = slam(*folders, folder.path());
  CHECK(expected.path.size() > 100);
  CHECK(slam(folder.path() / "s1.mcap", folder.path()) == expected);
}

TEST_CASE("bags that rosbags and mcap wrote give the same bytes as the folders", "[slow]") {
  const auto folders = kitti_sequence();
  if (!folders) return;
  const TempFolder folder;
  const fs::path venv = folder.path() / "venv";
  if (run("/usr/bin/python3", {"-m", "venv", venv.string()}, folder.path()).code != 0 ||
      run((venv / "bin/pip").string(), {"-q", "install", "rosbags==0.11.*", "mcap==1.*", "pillow"},
          folder.path())
              .code != 0) {
    std::cout << "SKIPPED: no venv with rosbags and mcap can be made here\n";
    return;
  }
  const fs::path bags = folder.path() / "bags";
  const Outcome made = run((venv / "bin/python").string(),
                           {SOURCE_FOLDER "/test/frontend/input/bags/make_bags.py",
                            folders->string(), bags.string(), std::to_string(kPairs)},
                           folder.path());
  INFO(made.err);
  REQUIRE(made.code == 0);
  const Result expected = slam(*folders, folder.path());
  int count = 0;
  for (const fs::directory_entry& bag : fs::directory_iterator(bags)) {
    INFO(bag.path());
    CHECK(slam(bag.path(), folder.path()) == expected);
    ++count;
  }
  CHECK(count == 11);
}

TEST_CASE("a bag that cannot be used ends in one line and code 3") {
  const TempFolder folder;
  write_text(folder.path() / "words.bag", "no bag");
  write_mcap(folder.path() / "imu.mcap", {{"/imu", "sensor_msgs/msg/Imu", ByteVector(80)}},
             {"none", 1, true});
  const auto check_refused = [&](const std::vector<std::string>& arguments, const std::string& why,
                                 int code = 3) {
    const Outcome outcome = run(HYBRID_SLAM, arguments, folder.path());
    CHECK(outcome.code == code);
    CHECK(std::count(outcome.err.begin(), outcome.err.end(), '\n') == 1);
    CHECK(outcome.err.find(why) != std::string::npos);
  };
  check_refused({"words.bag"}, "words.bag: no bag: neither ROS 1, MCAP nor rosbag2's sqlite3");
  check_refused({"imu.mcap"}, "there are /imu (sensor_msgs/Imu, 1)");
  check_refused({"imu.mcap", "--left-topic", "/l", "--right-topic", "/r"}, "no images on topic /l");
  check_refused({"nothing", "imu.mcap"}, "imu.mcap: only bags can follow one another", 2);
}

}  // namespace
}  // namespace hybrid_slam
