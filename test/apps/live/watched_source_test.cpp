#include "apps/slam/live/watched_source.h"

#include <fmt/format.h>
#include <catch2/catch.hpp>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <thread>

#include "cameras/files/input_error.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

std::string png(int value) {
  const cv::Mat pixels(8, 16, CV_8UC1, cv::Scalar(value));
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", pixels, bytes);
  return {bytes.begin(), bytes.end()};
}

struct Recording {
  TempFolder folder;
  std::vector<std::string> told;

  fs::path file(const char* camera, const std::string& name) const {
    return folder.path() / camera / name;
  }
  WatchedSource open(WatchOptions options = {}) {
    options.left = (folder.path() / "left").string();
    options.right = (folder.path() / "right").string();
    if (options.timeout == 10) options.timeout = 5;
    return WatchedSource(options);
  }
};

std::string stamp_name(int number) {
  return fmt::format("{}.png", 1'700'000'000'000'000'000 + number * 200'000'000LL);
}

}  // namespace

TEST_CASE("A folder that grows becomes sets in the order of its names") {
  Recording recording;
  WatchedSource source = recording.open();
  std::thread recorder([&] {
    for (int i = 0; i < 6; ++i) {
      write_text(recording.file("left", stamp_name(i)), png(10 + i));
      if (i == 3) std::this_thread::sleep_for(300ms);
      if (i != 4) write_text(recording.file("right", stamp_name(i)), png(10 + i));
    }
  });
  for (int i = 0; i < 6; ++i) {
    if (i == 4) continue;
    const auto set = source.next({});
    REQUIRE(set);
    CHECK(set->error.empty());
    CHECK(set->left.stamp == 1'700'000'000'000'000'000 + i * 200'000'000LL);
    CHECK(set->left.image.pixels[0] == 10 + i);
    CHECK(set->right.image.pixels[0] == 10 + i);
  }
  recorder.join();
  CHECK(of(source.counts().alone, LiveCamera::kLeft) == 1);
}

TEST_CASE("Files that a recorder removes again stop nothing") {
  Recording recording;
  const auto write = [&](int number) {
    write_text(recording.file("left", stamp_name(number)), png(50));
    write_text(recording.file("right", stamp_name(number)), png(50));
  };
  for (int i = 0; i < 4; ++i) write(i);
  WatchedSource source = recording.open();
  for (int i = 0; i < 4; ++i) REQUIRE(source.next({}));
  for (const char* const camera : {"left", "right"}) {
    fs::remove(recording.file(camera, stamp_name(0)));
  }
  std::thread recorder([&] {
    write_text(recording.file("left", stamp_name(4)), "");  // begun, and given up
    std::this_thread::sleep_for(500ms);
    fs::remove(recording.file("left", stamp_name(4)));
    write(5);
    write(6);
  });
  std::stop_source late;
  std::jthread patience([&](const std::stop_token& done) {
    for (int i = 0; i < 200 && !done.stop_requested(); ++i) std::this_thread::sleep_for(100ms);
    late.request_stop();
  });
  for (int i = 5; i < 7; ++i) {
    const auto set = source.next(late.get_token());
    CHECK(set);
    if (set) CHECK(set->left.stamp == 1'700'000'000'000'000'000 + i * 200'000'000LL);
  }
  recorder.join();
}

TEST_CASE("A file that is being written is waited for; a damaged one costs its own pair") {
  Recording recording;
  const std::string whole = png(50);
  for (int i = 0; i < 4; ++i) {
    write_text(recording.file("left", stamp_name(i)), png(50));
    if (i != 1 && i != 2) write_text(recording.file("right", stamp_name(i)), png(50));
  }
  write_text(recording.file("right", stamp_name(1)), whole.substr(0, whole.size() / 2));
  write_text(recording.file("right", stamp_name(2)), whole.substr(0, whole.size() / 2));
  std::thread recorder([&] {
    std::this_thread::sleep_for(600ms);
    std::ofstream file(recording.file("right", stamp_name(1)), std::ios::app | std::ios::binary);
    file << whole.substr(whole.size() / 2);
  });
  WatchedSource source = recording.open();
  for (int i = 0; i < 4; ++i) {
    const auto set = source.next({});
    REQUIRE(set);
    CHECK(set->error.empty() == (i != 2));
  }
  recorder.join();
}

TEST_CASE("Temporary names are no images, numbers need a rate") {
  Recording recording;
  WatchOptions options;
  for (int i = 0; i < 3; ++i) {
    for (const char* const camera : {"left", "right"}) {
      write_text(recording.file(camera, fmt::format("{}_{:06d}.png", camera, i)), png(1));
      write_text(recording.file(camera, ".hidden.png"), png(1));
      write_text(recording.file(camera, "x.png.tmp"), png(1));
    }
  }
  SECTION("with a rate") {
    options.rate = 4;
    WatchedSource source = recording.open(options);
    const auto first = source.next({});
    const auto second = source.next({});
    REQUIRE(second);
    CHECK(second->left.stamp - first->left.stamp == 250'000'000);
  }
  SECTION("without") {
    WatchedSource source = recording.open(options);
    CHECK_THROWS_WITH(source.next({}), Catch::Contains("--rate-hint"));
  }
}

TEST_CASE("Nothing comes, or nothing that belongs together") {
  Recording recording;
  WatchOptions options;
  options.timeout = 0.7;
  SECTION("nothing of one camera") {
    write_text(recording.file("left", stamp_name(0)), png(1));
    WatchedSource source = recording.open(options);
    CHECK_THROWS_WITH(source.next({}),
                      Catch::Contains("no image of the right camera came in 0.7 s"));
  }
  SECTION("clocks that are seconds apart") {
    for (int i = 0; i < 12; ++i) {
      write_text(recording.file("left", stamp_name(i)), png(1));
      write_text(recording.file("right", stamp_name(i + 100)), png(1));
    }
    WatchedSource source = recording.open(options);
    CHECK_THROWS_WITH(source.next({}), Catch::Contains("no times in common"));
  }
}

}  // namespace hybrid_slam
