#include "apps/slam/frame_stream.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <thread>

#include "test/apps/small_recording.h"

namespace hybrid_slam {
namespace {

using namespace std::chrono_literals;

SlamOptions features_of_start() {
  SlamOptions options;
  options.features = 300;
  options.distribute();
  return options;
}

// Of a stereo pair in realtime. Nobody takes its frames yet.
struct StartingStream {
  SmallRecording recording = make_small_recording(40);
  FrameStream frames{
      {recording.cameras.stereo, std::nullopt},
      features_of_start(),
      {.reorder = {50'000'000, true}, .threads = 1, .drop = true, .device = SiftDevice::kCpu}};
  std::size_t pushed = 0;

  void push(std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      frames.push(recording.moments.at(pushed++).stereo);
      frames.flush();
    }
  }
  std::int64_t dropped() const { return frames.counts(CameraKind::kStereo).dropped; }
};

TEST_CASE("What comes while a session starts is not dropped") {
  StartingStream stream;
  stream.push(3);
  while (!stream.frames.upsampling()) std::this_thread::sleep_for(1ms);
  stream.push(9);
  CHECK(stream.dropped() == 0);
  stream.frames.close();
  Nanoseconds last = -1;
  int count = 0;
  while (const auto item = stream.frames.next()) {
    if (!item->frame) continue;
    CHECK(item->frame->time > last);
    last = item->frame->time;
    ++count;
  }
  CHECK(count == 12);
}

TEST_CASE("A start that takes too long drops, too: later frames do not wait behind it") {
  StartingStream stream;
  stream.push(3);
  while (!stream.frames.upsampling()) std::this_thread::sleep_for(1ms);
  stream.push(37);
  CHECK(stream.dropped() == 35);  // but the two newest
}

}  // namespace
}  // namespace hybrid_slam
