#include "apps/slam/channel.h"

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
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

TEST_CASE("Whoever waits until a channel is empty goes on when the last value is taken",
          "[pipeline]") {
  Channel<int> channel(2);
  CHECK(channel.push(1));
  CHECK(channel.push(2));
  std::atomic<bool> empty = false;
  {
    const std::jthread waiter([&] {
      channel.wait_empty();
      empty = true;
    });
    CHECK(channel.pop() == 1);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    CHECK_FALSE(empty);
    CHECK(channel.pop() == 2);
  }
  CHECK(empty);
}

TEST_CASE("Latest hands out the newest value and wakes those who wait for one", "[pipeline]") {
  Latest<int> latest;
  CHECK(latest.get() == nullptr);
  CHECK(latest.version() == 0);
  latest.publish(std::make_shared<const int>(1));
  const auto old = latest.get();
  std::size_t seen = 0;
  CHECK(latest.next(seen) == old);  // published already: no need to wait
  CHECK(seen == latest.version());
  std::shared_ptr<const int> after;
  {
    const std::jthread reader([&] { after = latest.next(seen); });
    latest.publish(std::make_shared<const int>(2));
  }
  REQUIRE(after);
  CHECK(*after == 2);
  CHECK(*old == 1);
  CHECK(seen == latest.version());
  after = old;
  {
    const std::jthread reader([&] { after = latest.next(seen); });
    latest.close();
  }
  CHECK(after == nullptr);
  CHECK(*latest.get() == 2);
}

}  // namespace
}  // namespace hybrid_slam
