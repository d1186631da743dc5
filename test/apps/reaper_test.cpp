#include "apps/slam/reaper.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <optional>
#include <thread>

namespace hybrid_slam {
namespace {

// Says in which thread it was freed.
struct Witness {
  explicit Witness(std::atomic<std::thread::id>& where) : freed_in(where) {}
  ~Witness() { freed_in = std::this_thread::get_id(); }
  std::atomic<std::thread::id>& freed_in;
};

TEST_CASE("What is given up is freed in the reaper's thread, or at once after its end", "[slam]") {
  std::atomic<std::thread::id> first;
  std::atomic<std::thread::id> second;
  std::shared_ptr<const Witness> kept;
  {
    Reaper reaper;
    auto value = reaper.adopt(std::shared_ptr<const Witness>(std::make_shared<Witness>(first)));
    kept = reaper.adopt(std::shared_ptr<const Witness>(std::make_shared<Witness>(second)));
    CHECK(reaper.adopt(std::shared_ptr<const Witness>()) == nullptr);
    const auto copy = value;
    value.reset();
    CHECK(first.load() == std::thread::id());  // somebody still holds it
  }
  CHECK(first.load() != std::thread::id());
  CHECK(first.load() != std::this_thread::get_id());
  CHECK(second.load() == std::thread::id());
  kept.reset();
  CHECK(second.load() == std::this_thread::get_id());
}

}  // namespace
}  // namespace hybrid_slam
