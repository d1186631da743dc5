#include "apps/slam/sift_pool.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <stdexcept>
#include <thread>
#include <vector>

namespace hybrid_slam {
namespace {

// So many threads take an extractor several times and hold it for a while; how many of them held
// one at the same time, at most.
int most_at_once(SiftPool& pool, int threads) {
  std::atomic<int> holding = 0, most = 0;
  {
    std::vector<std::jthread> workers;
    for (int i = 0; i < threads; ++i) {
      workers.emplace_back([&] {
        for (int turn = 0; turn < 4; ++turn) {
          const SiftPool::Lease sift = pool.take();
          const int now = ++holding;
          for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
          }
          std::this_thread::sleep_for(std::chrono::milliseconds(2));
          --holding;
        }
      });
    }
  }
  return most;
}

TEST_CASE("A pool makes no more extractors than its limit, and each serves one thread at a time",
          "[pipeline]") {
  SiftPool pool(SiftDevice::kCpu, {}, 2, 2);
  CHECK(pool.bounded());
  CHECK(most_at_once(pool, 6) == 2);
  CHECK(pool.made() == 2);
}

TEST_CASE("On the CPU every thread that asks gets an extractor, and none is made without need",
          "[pipeline]") {
  SiftPool pool(SiftDevice::kCpu, {}, 2);
  CHECK_FALSE(pool.bounded());
  for (int turn = 0; turn < 3; ++turn) CHECK(pool.take() != nullptr);
  CHECK(pool.made() == 1);
  {
    const SiftPool::Lease one = pool.take(), other = pool.take(), third = pool.take();
    CHECK(one.get() != other.get());
    CHECK(pool.made() == 3);
  }
  pool.take();
  CHECK(pool.made() == 3);
}

TEST_CASE("An extractor that cannot be made leaves its place to the next", "[pipeline]") {
  SiftOptions options;
  options.max_features = 0;
  SiftPool pool(SiftDevice::kCpu, options, 2, 1);
  for (int turn = 0; turn < 2; ++turn) CHECK_THROWS_AS(pool.take(), std::invalid_argument);
  CHECK(pool.made() == 0);
}

}  // namespace
}  // namespace hybrid_slam
