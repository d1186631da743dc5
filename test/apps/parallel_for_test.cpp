#include "apps/slam/parallel_for.h"

#include <algorithm>
#include <atomic>
#include <latch>
#include <map>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

TEST_CASE("parallel_for does everything once, in threads with numbers of their own") {
  for (const int threads : {0, 1, 2, 5}) {
    for (const std::size_t count : {0U, 1U, 3U, 200U}) {
      std::mutex mutex;
      std::map<std::size_t, int> done;
      std::map<std::size_t, std::set<std::thread::id>> thread_of;
      parallel_for(count, threads, [&](std::size_t i, std::size_t worker) {
        const std::lock_guard lock(mutex);
        ++done[i];
        thread_of[worker].insert(std::this_thread::get_id());
      });
      CHECK(done.size() == count);
      for (const auto& [i, times] : done) {
        CHECK(i < count);
        CHECK(times == 1);
      }
      for (const auto& [worker, ids] : thread_of) {
        CHECK(worker < static_cast<std::size_t>(std::max(threads, 1)));
        CHECK(ids.size() == 1);
      }
    }
  }
}

TEST_CASE("parallel_for runs as many calls at a time as it has threads") {
  std::latch all(3);
  parallel_for(3, 3, [&](std::size_t, std::size_t) { all.arrive_and_wait(); });
  CHECK(all.try_wait());
}

TEST_CASE("parallel_for throws what the first in order threw, and begins no more") {
  for (const int threads : {1, 4}) {
    std::atomic<int> begun = 0;
    std::latch both(threads > 1 ? 2 : 1);
    const auto work = [&](std::size_t i, std::size_t) {
      ++begun;
      if (i > 1) return;
      both.arrive_and_wait();
      throw std::runtime_error(i == 0 ? "first" : "second");
    };
    std::string thrown;
    try {
      parallel_for(100, threads, work);
    } catch (const std::runtime_error& error) {
      thrown = error.what();
    }
    CHECK(thrown == "first");
    if (threads == 1) CHECK(begun == 1);
  }
}

}  // namespace
}  // namespace hybrid_slam
