#include "apps/slam/reorder_buffer.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>
#include <vector>

namespace hybrid_slam {
namespace {

using Clock = ReorderBuffer::Clock;
using Event = std::pair<Nanoseconds, CameraKind>;
constexpr Nanoseconds kMs = 1'000'000;

SensorInput input(CameraKind camera, Nanoseconds time) {
  if (camera == CameraKind::kFisheye) return FisheyeImage{time, {}};
  return StereoImages{time, {}, {}};
}

std::vector<Event> take_all(ReorderBuffer& buffer, Clock::time_point now, bool flush = false) {
  std::vector<Event> taken;
  while (const auto one = buffer.take(now, flush))
    taken.emplace_back(time_of(*one), camera_of(*one));
  return taken;
}

TEST_CASE("Inputs that are shuffled within the window come out in order, whatever the shuffle",
          "[slam]") {
  std::vector<Event> ordered;
  for (Nanoseconds time = 0; time < 6000 * kMs; time += 50 * kMs) {
    ordered.emplace_back(time, CameraKind::kStereo);
    if (time % (150 * kMs) == 0) ordered.emplace_back(time, CameraKind::kFisheye);
  }
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::vector<std::pair<Nanoseconds, Event>> shuffled;  // by when it arrives
    for (const Event& event : ordered) {
      shuffled.emplace_back(event.first + static_cast<Nanoseconds>(random() % 499) * kMs, event);
    }
    std::sort(shuffled.begin(), shuffled.end());
    ReorderBuffer buffer({500 * kMs, false}, true);
    std::vector<Event> released;
    for (const auto& [arrival, event] : shuffled) {
      CHECK(buffer.add(input(event.second, event.first), {}) == PushResult::kTaken);
      for (const Event& out : take_all(buffer, {})) released.push_back(out);
    }
    CHECK(released.size() < ordered.size());  // the last ones wait
    for (const Event& out : take_all(buffer, {}, true)) released.push_back(out);
    CHECK(released == ordered);
  }
}

TEST_CASE("In realtime a frame waits for the other camera, but not for long", "[slam]") {
  ReorderBuffer buffer({50 * kMs, true}, true);
  const Clock::time_point start{};
  buffer.add(input(CameraKind::kStereo, 100 * kMs), start);
  CHECK(take_all(buffer, start + std::chrono::milliseconds(49)).empty());
  CHECK(buffer.next_due() == start + std::chrono::milliseconds(50));
  buffer.add(input(CameraKind::kFisheye, 100 * kMs), start + std::chrono::milliseconds(20));
  CHECK(take_all(buffer, start + std::chrono::milliseconds(20)) ==
        std::vector<Event>{{100 * kMs, CameraKind::kStereo}, {100 * kMs, CameraKind::kFisheye}});
  // Without a partner, the clock decides, or a frame that is later by the window.
  buffer.add(input(CameraKind::kStereo, 300 * kMs), start);
  CHECK(take_all(buffer, start + std::chrono::milliseconds(50)).size() == 1);
  buffer.add(input(CameraKind::kStereo, 500 * kMs), start);
  buffer.add(input(CameraKind::kStereo, 550 * kMs), start);
  CHECK(take_all(buffer, start) == std::vector<Event>{{500 * kMs, CameraKind::kStereo}});
}

TEST_CASE("A stereo pair alone waits for nobody", "[slam]") {
  ReorderBuffer buffer({50 * kMs, true}, false);
  buffer.add(input(CameraKind::kStereo, 0), {});
  CHECK(take_all(buffer, {}).size() == 1);
}

TEST_CASE("What comes too late, or twice, is left out", "[slam]") {
  ReorderBuffer buffer({50 * kMs, false}, true);
  const auto add = [&](CameraKind camera, Nanoseconds time) {
    return buffer.add(input(camera, time * kMs), {});
  };
  CHECK(add(CameraKind::kStereo, 100) == PushResult::kTaken);
  CHECK(add(CameraKind::kStereo, 100) == PushResult::kDuplicate);
  CHECK(add(CameraKind::kStereo, 200) == PushResult::kTaken);
  CHECK(take_all(buffer, {}).size() == 1);
  CHECK(add(CameraKind::kStereo, 100) == PushResult::kDuplicate);
  CHECK(add(CameraKind::kFisheye, 100) == PushResult::kTaken);  // after the pair of its time
  CHECK(add(CameraKind::kFisheye, 99) == PushResult::kLate);
  CHECK(add(CameraKind::kFisheye, 201) == PushResult::kTaken);
}

TEST_CASE("A clock that was set back begins anew; one wrong stamp does not", "[slam]") {
  ReorderBuffer buffer({50 * kMs, false}, false);
  const auto add = [&](Nanoseconds time) {
    const PushResult result = buffer.add(input(CameraKind::kStereo, time * kMs), {});
    take_all(buffer, {});
    return result;
  };
  for (Nanoseconds time = 100'000; time < 101'000; time += 100) {
    CHECK(add(time) == PushResult::kTaken);
  }
  CHECK(add(5000) == PushResult::kLate);
  CHECK(add(101'000) == PushResult::kTaken);
  CHECK(add(5100) == PushResult::kLate);
  CHECK(add(5200) == PushResult::kLate);
  CHECK(add(5300) == PushResult::kTaken);
  CHECK(add(5400) == PushResult::kTaken);
  // Late by less than any clock is set: as long as it lasts.
  for (int i = 0; i < 5; ++i) CHECK(add(4900 + i) == PushResult::kLate);
}

}  // namespace
}  // namespace hybrid_slam
