#include "apps/pipeline/channel.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <numeric>
#include <thread>
#include <vector>

namespace hybrid_slam {
namespace {

TEST_CASE("A channel delivers in order and never holds more than its capacity", "[pipeline]") {
  Channel<int> channel(3);
  std::vector<int> received;
  std::size_t most = 0;
  bool all_pushed = true;
  {
    const std::jthread sender([&] {
      for (int i = 0; i < 200; ++i) all_pushed = channel.push(i) && all_pushed;
      channel.close();
    });
    while (const auto value = channel.pop()) {
      most = std::max(most, channel.size());
      received.push_back(*value);
    }
  }
  std::vector<int> expected(200);
  std::iota(expected.begin(), expected.end(), 0);
  CHECK(all_pushed);
  CHECK(received == expected);
  CHECK(most <= 3);
}

TEST_CASE("try_push drops what finds no room", "[pipeline]") {
  Channel<int> channel(2);
  CHECK(channel.try_push(1));
  CHECK(channel.try_push(2));
  CHECK_FALSE(channel.try_push(3));
  CHECK(channel.pop() == 1);
  CHECK(channel.try_push(4));
  CHECK(channel.size() == 2);
}

TEST_CASE("A closed channel still delivers what is queued, and takes nothing", "[pipeline]") {
  Channel<int> channel(2);
  CHECK(channel.push(1));
  channel.close();
  CHECK_FALSE(channel.push(2));
  CHECK_FALSE(channel.try_push(2));
  CHECK(channel.pop() == 1);
  CHECK_FALSE(channel.pop());
}

TEST_CASE("Closing wakes whoever waits", "[pipeline]") {
  Channel<int> full(1);
  Channel<int> empty(1);
  CHECK(full.push(1));
  bool pushed = true;
  std::optional<int> popped = 1;
  {
    const std::jthread sender([&] { pushed = full.push(2); });
    const std::jthread receiver([&] { popped = empty.pop(); });
    full.close();
    empty.close();
  }
  CHECK_FALSE(pushed);
  CHECK_FALSE(popped);
}

TEST_CASE("Latest hands out the newest value and wakes those who wait for one", "[pipeline]") {
  Latest<int> latest;
  CHECK(latest.get() == nullptr);
  latest.publish(std::make_shared<const int>(1));
  const auto old = latest.get();
  const std::size_t seen = latest.version();
  int after = 0;
  {
    const std::jthread reader([&] {
      latest.wait_beyond(seen);
      after = *latest.get();
    });
    latest.publish(std::make_shared<const int>(2));
  }
  CHECK(after == 2);
  CHECK(*old == 1);
  {
    const std::jthread reader([&] { latest.wait_beyond(latest.version() + 1); });
    latest.close();
  }
}

}  // namespace
}  // namespace hybrid_slam
