// What cameras, cables, clocks and consumers do wrong in the field. None may end the session; what
// was known before is kept, the state tells, and the vehicle is found again. The faults of the
// disk and of the process are in streaming_test.cpp.
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "apps/slam/session.h"
#include "test/apps/small_recording.h"

namespace hybrid_slam {
namespace {

constexpr int kMoments = 60;
constexpr int kBegin = 20;  // the fault's first moment

const SmallRecording& recording() {
  static const SmallRecording made = make_small_recording(kMoments);
  return made;
}

SlamOptions small_options() {
  SlamOptions options;
  options.features = 400;
  options.distribute();
  return options;
}

struct Heard {
  std::vector<FrameResult> frames;  // in the order of their times
  std::map<std::string, int> left_out;
  std::size_t keyframes = 0;
  bool finished = false;
};

// What is pushed for a moment: anything from nothing to several pairs.
using Fault = std::function<std::vector<StereoImages>(int moment, StereoImages pair)>;

Heard run(const Fault& fault) {
  Heard heard;
  SessionObservers observers;
  observers.frame = [&](const FrameResult& frame) { heard.frames.push_back(frame); };
  observers.left_out = [&](const LeftOut& input) { ++heard.left_out[input.reason]; };
  SessionOptions options;
  options.mode = SessionMode::kEveryFrame;
  Session session({recording().cameras.stereo, std::nullopt}, small_options(), options, observers);
  for (int i = 0; i < kMoments; ++i) {
    StereoImages pair = recording().moments[static_cast<std::size_t>(i)].stereo;
    for (StereoImages& input : fault(i, std::move(pair))) session.push(std::move(input));
  }
  session.finish();
  heard.finished = true;
  heard.keyframes = session.map()->keyframe_count();
  return heard;
}

bool names(const FrameResult& frame, Cause cause) {
  return std::any_of(frame.causes.begin(), frame.causes.end(),
                     [&](const FoundCause& found) { return found.cause == cause; });
}

int count(const Heard& heard, Cause cause) {
  return static_cast<int>(
      std::count_if(heard.frames.begin(), heard.frames.end(),
                    [&](const FrameResult& frame) { return names(frame, cause); }));
}

// The frames of the last `seconds` all have poses, near the truth of the moment that they show.
void check_well_at_the_end(const Heard& heard, double seconds = 2) {
  REQUIRE(heard.finished);
  REQUIRE_FALSE(heard.frames.empty());
  const Rigid3d first_from_world = inverse(recording().world_from_left[0]);
  for (const FrameResult& frame : heard.frames) {
    const auto moment = static_cast<std::size_t>(frame.time / SmallRecording::kPeriod);
    if (moment >= recording().world_from_left.size()) continue;  // of a clock that jumped
    if (frame.has_pose()) {
      const Eigen::Vector3d error =
          inverse(frame.tracked.cam_from_world).translation() -
          (first_from_world * recording().world_from_left[moment]).translation();
      INFO("moment " << moment);
      CHECK(error.norm() < 0.05);
    } else {
      CHECK(to_seconds(frame.time) < to_seconds(kMoments * SmallRecording::kPeriod) - seconds);
    }
  }
  CHECK(heard.frames.back().has_pose());
}

bool during(int moment, double seconds) {
  return moment >= kBegin &&
         moment < kBegin + static_cast<int>(seconds / to_seconds(SmallRecording::kPeriod));
}

TEST_CASE("Frames that are missing, singly or for two seconds, cost only themselves", "[slam]") {
  std::mt19937 random(1);
  const Heard tenth = run([&](int i, StereoImages pair) -> std::vector<StereoImages> {
    if (i > 3 && random() % 10 == 0) return {};
    return {std::move(pair)};
  });
  check_well_at_the_end(tenth);
  CHECK(std::all_of(tenth.frames.begin(), tenth.frames.end(),
                    [](const FrameResult& frame) { return frame.has_pose(); }));
  const Heard burst = run([&](int i, StereoImages pair) -> std::vector<StereoImages> {
    if (during(i, 2)) return {};
    return {std::move(pair)};
  });
  check_well_at_the_end(burst);
  CHECK(count(burst, Cause::kTimeJump) == 1);
}

TEST_CASE("A stream that is cut for five seconds comes back", "[slam]") {
  const Heard heard = run([&](int i, StereoImages pair) -> std::vector<StereoImages> {
    if (during(i, 5)) return {};
    return {std::move(pair)};
  });
  check_well_at_the_end(heard);
  CHECK(count(heard, Cause::kTimeJump) == 1);
}

TEST_CASE("Frames that come twice are left out", "[slam]") {
  const Heard heard = run([&](int, StereoImages pair) {
    return std::vector<StereoImages>{pair, pair};
  });
  check_well_at_the_end(heard);
  CHECK(heard.frames.size() == kMoments);
  CHECK(heard.left_out.at("duplicate") == kMoments);
}

TEST_CASE("A camera that shows the same picture for three seconds is named", "[slam]") {
  const Heard heard = run([&](int i, StereoImages pair) {
    if (during(i, 3)) pair.left = recording().moments[kBegin - 1].stereo.left;
    return std::vector<StereoImages>{std::move(pair)};
  });
  CHECK(heard.finished);
  CHECK(count(heard, Cause::kFrozen) == 15);
  CHECK(heard.frames.back().has_pose());
}

TEST_CASE("A pair that is swapped for three seconds is named", "[slam]") {
  const Heard heard = run([&](int i, StereoImages pair) {
    if (during(i, 3)) std::swap(pair.left, pair.right);
    return std::vector<StereoImages>{std::move(pair)};
  });
  CHECK(heard.finished);
  CHECK(count(heard, Cause::kSwapped) >= 15);
  CHECK(names(heard.frames[kBegin], Cause::kSwapped));
  CHECK_FALSE(names(heard.frames.back(), Cause::kSwapped));
  CHECK(heard.frames.back().has_pose());
}

TEST_CASE("Gain that jumps from frame to frame changes nothing", "[slam]") {
  const Heard heard = run([&](int i, StereoImages pair) {
    const double gain = i % 2 == 0 ? 0.6 : 1.4;
    for (GrayImage* image : {&pair.left, &pair.right}) {
      for (std::uint8_t& pixel : image->pixels) {
        pixel = static_cast<std::uint8_t>(std::min(255.0, gain * pixel));
      }
    }
    return std::vector<StereoImages>{std::move(pair)};
  });
  check_well_at_the_end(heard);
  CHECK(std::all_of(heard.frames.begin(), heard.frames.end(),
                    [](const FrameResult& frame) { return frame.has_pose(); }));
}

TEST_CASE("Five seconds of black lose the vehicle, which is found again", "[slam]") {
  const Heard heard = run([&](int i, StereoImages pair) {
    if (during(i, 5)) {
      std::fill(pair.left.pixels.begin(), pair.left.pixels.end(), 0);
      std::fill(pair.right.pixels.begin(), pair.right.pixels.end(), 0);
    }
    return std::vector<StereoImages>{std::move(pair)};
  });
  check_well_at_the_end(heard);
  CHECK(count(heard, Cause::kDark) == 25);
  CHECK(heard.frames[kBegin + 10].state == TrackingState::kLost);
}

TEST_CASE("A clock that jumps, forwards and backwards, is named and followed", "[slam]") {
  const Heard heard = run([&](int i, StereoImages pair) {
    if (i >= kBegin && i < 40) pair.time += 3'600'000'000'000;
    return std::vector<StereoImages>{std::move(pair)};
  });
  CHECK(heard.finished);
  CHECK(count(heard, Cause::kTimeJump) >= 2);
  CHECK(heard.frames.size() >= kMoments - 4);  // the first ones of the older time look late
  CHECK(heard.frames.back().has_pose());
}

TEST_CASE("A consumer that sleeps holds nobody up and loses no pose", "[slam]") {
  std::atomic<int> heard = 0;
  SessionObservers observers;
  observers.frame = [&](const FrameResult&) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    ++heard;
  };
  SessionOptions options;
  options.drop = false;
  Session session({recording().cameras.stereo, std::nullopt}, small_options(), options, observers);
  for (const auto& moment : recording().moments) session.push(moment.stereo);
  session.finish();
  CHECK(heard == kMoments);
  CHECK(session.counts().overruns == 0);
  CHECK(session.counts().stereo.dropped == 0);
}

}  // namespace
}  // namespace hybrid_slam
