#include "apps/pipeline/paced_camera.h"

#include <vector>

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

using Clock = std::chrono::steady_clock;

TEST_CASE("A paced camera hands out every index, each when it is due", "[pipeline]") {
  const auto start = Clock::now();
  PacedCamera camera(5, 50, {});
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(camera.next() == i);
    CHECK(Clock::now() - start >= std::chrono::milliseconds(20 * i));
  }
  CHECK_FALSE(camera.next());
  CHECK(camera.finish() == 0);
}

TEST_CASE("A paced camera keeps two images for who is late, and counts what it drops",
          "[pipeline]") {
  PacedCamera camera(50, 1e5, {});
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  CHECK(camera.next() == 0U);
  CHECK(camera.next() == 1U);
  CHECK_FALSE(camera.next());
  CHECK(camera.finish() == 48);
}

TEST_CASE("A paced camera that is cancelled or finished does not wait for its next image",
          "[pipeline]") {
  const auto start = Clock::now();
  std::stop_source cancel;
  PacedCamera camera(10, 0.001, cancel.get_token());
  CHECK(camera.next() == 0U);
  {
    const std::jthread canceller([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      cancel.request_stop();
    });
    CHECK_FALSE(camera.next());  // the next image is due in a quarter of an hour
  }
  PacedCamera other(10, 0.001, {});
  CHECK(other.next() == 0U);
  CHECK(other.finish() == 0);
  CHECK_FALSE(other.next());
  CHECK(Clock::now() - start < std::chrono::seconds(10));
}

}  // namespace
}  // namespace hybrid_slam
