#include "apps/slam/live/stream_source.h"

#include <catch2/catch.hpp>

#include "test/apps/live/fake_stream.h"

namespace hybrid_slam {
namespace {

using namespace std::chrono_literals;

struct Rig {
  std::shared_ptr<FakeCamera> left = std::make_shared<FakeCamera>();
  std::shared_ptr<FakeCamera> right = std::make_shared<FakeCamera>();
  StreamOptions options;
  std::vector<std::string> told;

  std::unique_ptr<StreamSource> open() {
    auto source = std::make_unique<StreamSource>(
        std::vector{fake_spec(LiveCamera::kLeft, left), fake_spec(LiveCamera::kRight, right)},
        options);
    source->set_tell([this](const std::string& line) { told.push_back(line); });
    return source;
  }
  int count_told(const std::string& part) const {
    int count = 0;
    for (const std::string& line : told) count += line.find(part) != std::string::npos ? 1 : 0;
    return count;
  }
};

void check_pair(const std::optional<ImageSet>& set) {
  REQUIRE(set);
  CHECK(set->left.image.pixels[0] == set->right.image.pixels[0]);
}

}  // namespace

TEST_CASE("Two streams become sets, stamped when they came") {
  Rig rig;
  rig.right->delay = 3ms;
  const auto source = rig.open();
  std::int64_t last = 0;
  for (int i = 0; i < 30; ++i) {
    const auto set = source->next({});
    const auto now = std::chrono::duration_cast<std::chrono::nanoseconds>(
                         std::chrono::system_clock::now().time_since_epoch())
                         .count();
    check_pair(set);
    CHECK(set->left.stamp > last);
    CHECK(std::abs(now - set->left.stamp) < 1'000'000'000);
    last = set->left.stamp;
  }
}

TEST_CASE("What waits in a connection is older than it looks, and left out") {
  Rig rig;
  rig.left->waiting = 9;
  rig.left->says_rate = 50;
  const auto source = rig.open();
  for (int i = 0; i < 5; ++i) check_pair(source->next({}));
  CHECK(of(source->counts().held_up, LiveCamera::kLeft) >= 9);
}

TEST_CASE("A stream that says too low a rate is refused") {
  Rig rig;
  rig.left->says_rate = 20;  // it has 50
  rig.options.timeout = 30;
  const auto source = rig.open();
  CHECK_THROWS_WITH(source->next({}), Catch::Contains("--rate-hint"));
}

TEST_CASE("A stream that is lost is said to be once, and taken up again") {
  Rig rig;
  const auto source = rig.open();
  for (int i = 0; i < 5; ++i) check_pair(source->next({}));
  rig.right->plugged = false;
  std::thread plug([&] {
    std::this_thread::sleep_for(1500ms);
    rig.right->plugged = true;
  });
  for (int i = 0; i < 30; ++i) check_pair(source->next({}));
  plug.join();
  CHECK(rig.count_told("the right camera is lost") == 1);
  CHECK(rig.count_told("the right camera is back after") == 1);
  CHECK(rig.right->opened == 2);
  CHECK(of(source->counts().lost, LiveCamera::kRight) == 1);
  CHECK(of(source->counts().alone, LiveCamera::kLeft) > 30);
}

TEST_CASE("A stream that never delivers") {
  Rig rig;
  rig.options.timeout = 0.5;
  rig.right->plugged = false;
  const auto source = rig.open();
  CHECK_THROWS_WITH(source->next({}),
                    "fake right: the right camera delivers nothing: no image in 0.5 s (fake: "
                    "cannot be opened); --timeout waits longer");
}

TEST_CASE("Images side by side are split") {
  const auto both = std::make_shared<FakeCamera>();
  both->width = 6;
  StreamOptions options;
  options.split = true;
  StreamSource source({fake_spec(LiveCamera::kLeft, both)}, options);
  const auto set = source.next({});
  check_pair(set);
  CHECK(set->left.image.width == 3);
  CHECK(set->right.image.pixels.size() == 6);
  both->width = 7;
  StreamSource odd({fake_spec(LiveCamera::kLeft, both)}, options);
  const auto bad = odd.next({});
  REQUIRE(bad);
  CHECK_THAT(bad->error, Catch::Contains("no two of equal width"));
}

TEST_CASE("Whoever takes sets slowly gets the newest ones") {
  Rig rig;
  const auto source = rig.open();
  check_pair(source->next({}));
  std::this_thread::sleep_for(1s);
  for (int i = 0; i < 10; ++i) check_pair(source->next({}));
  const auto counts = source->counts();
  CHECK(of(counts.dropped, LiveCamera::kLeft) > 30);
  CHECK(of(counts.dropped, LiveCamera::kRight) > 30);
}

TEST_CASE("A request to stop ends the waiting") {
  Rig rig;
  rig.options.timeout = 60;
  rig.right->plugged = false;
  const auto source = rig.open();
  std::stop_source stop;
  std::thread later([&] {
    std::this_thread::sleep_for(300ms);
    stop.request_stop();
  });
  CHECK_FALSE(source->next(stop.get_token()));
  later.join();
}

}  // namespace hybrid_slam
