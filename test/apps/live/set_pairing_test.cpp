#include "apps/slam/live/set_pairing.h"

#include <catch2/catch.hpp>
#include <random>

#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kStart = 1'700'000'000'000 * kMs;
constexpr std::int64_t kPeriod = 200 * kMs;

// The image's width is its number.
StampedImage image(std::int64_t stamp, int number) { return {stamp, {number, 1, {}}, {}}; }

struct Numbers {
  int left = 0, right = 0, fisheye = -1;
  bool operator==(const Numbers&) const = default;
};

std::vector<Numbers> take_all(SetPairing& pairing) {
  std::vector<Numbers> numbers;
  while (auto set = pairing.take()) {
    numbers.push_back({set->left.image.width, set->right.image.width,
                       set->fisheye ? set->fisheye->image.width : -1});
  }
  return numbers;
}

// When each image of two cameras comes, in order of time.
struct Arrival {
  std::int64_t stamp = 0;
  LiveCamera camera = LiveCamera::kLeft;
  int number = 0;
};

std::vector<Arrival> arrivals(int count, double right_delay, double right_period, double jitter,
                              std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, jitter);
  std::vector<Arrival> all;
  for (int i = 0; i < count; ++i) {
    const auto at = [&](double ms) {
      return kStart + static_cast<std::int64_t>((ms + noise(random)) * 1e6);
    };
    all.push_back({at(200.0 * i), LiveCamera::kLeft, i});
    all.push_back({at(right_period * i + right_delay), LiveCamera::kRight, i});
  }
  std::sort(all.begin(), all.end(),
            [](const Arrival& a, const Arrival& b) { return a.stamp < b.stamp; });
  return all;
}

std::vector<Numbers> pair_arrivals(const std::vector<Arrival>& all, SetPairing& pairing) {
  std::vector<Numbers> numbers;
  for (const Arrival& one : all) {
    pairing.add(one.camera, image(one.stamp, one.number));
    for (const Numbers& set : take_all(pairing)) numbers.push_back(set);
  }
  return numbers;
}

}  // namespace

TEST_CASE("Images that come together are a set, with the offset taken out") {
  for (const double delay : {0.0, 3.0, -40.0, 70.0}) {
    INFO(delay);
    SetPairing pairing({});
    const auto sets = pair_arrivals(arrivals(60, delay, 200, 4, 7), pairing);
    CHECK(sets.size() >= 60 - SetPairing::kSettling - 1);
    for (const Numbers& set : sets) CHECK(set.left == set.right);
    const auto notes = pairing.notes();
    REQUIRE(notes.size() == 1);
    const double found = std::stod(notes[0].substr(notes[0].find("come ") + 5));
    CHECK(found == Approx(delay).margin(5));
  }
}

TEST_CASE("Arrivals that are jolted at first are looked at longer") {
  SetPairing pairing({});
  auto all = arrivals(60, 10, 200, 4, 7);
  for (int i = 0; i < 16; i += 8) all[static_cast<std::size_t>(i)].stamp += 70 * kMs;
  const auto sets = pair_arrivals(all, pairing);
  CHECK(sets.size() >= 60 - 2 * SetPairing::kSettling - 1);
  CHECK(sets.size() < 60 - SetPairing::kSettling);
}

TEST_CASE("Images half a period apart belong to nobody") {
  SetPairing pairing({});
  CHECK_THROWS_WITH(pair_arrivals(arrivals(60, 98, 200, 6, 3), pairing),
                    Catch::Contains("belong together is unclear"));
}

TEST_CASE("Cameras of unlike rates are refused") {
  SetPairing pairing({});
  CHECK_THROWS_WITH(pair_arrivals(arrivals(60, 0, 173, 0, 3), pairing),
                    Catch::Contains("unclear") && Catch::Contains("173.0"));
}

TEST_CASE("Cameras that have nothing to do with one another look clear once in a hundred at most") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> anywhere(0, 200);
  int clear = 0;
  constexpr int kTrials = 3000;
  for (int trial = 0; trial < kTrials; ++trial) {
    SetPairing pairing({});
    try {
      for (std::size_t i = 0; i < 4 * SetPairing::kSettling && !pairing.settled(); ++i) {
        const auto at = kStart + static_cast<std::int64_t>(i) * kPeriod;
        pairing.add(LiveCamera::kLeft, image(at, 1));
        pairing.add(LiveCamera::kRight,
                    image(at + static_cast<std::int64_t>(1e6 * anywhere(random)), 1));
        pairing.take();
      }
      clear += pairing.settled() ? 1 : 0;
    } catch (const InputError&) {
    }
  }
  CHECK(clear < kTrials / 100);
}

TEST_CASE("A clock that drifts away is noticed") {
  SetPairing pairing({});
  CHECK_THROWS_WITH(pair_arrivals(arrivals(400, 0, 199, 1, 3), pairing),
                    Catch::Contains("unclear"));
  CHECK(pairing.settled());  // at first
}

TEST_CASE("Sensors' stamps are paired as those of files are") {
  PairingOptions options;
  options.stamps = StampKind::kSensor;
  options.fisheye = true;
  SetPairing pairing(options);
  std::vector<Numbers> sets;
  for (int i = 0; i < 20; ++i) {
    const std::int64_t stamp = kStart + i * kPeriod;
    if (i != 7) pairing.add(LiveCamera::kLeft, image(stamp, i));
    if (i != 9) pairing.add(LiveCamera::kRight, image(stamp + 15 * kMs, i));
    if (i != 11) pairing.add(LiveCamera::kFisheye, image(stamp + 9 * kMs, i));
    for (const Numbers& set : take_all(pairing)) sets.push_back(set);
  }
  pairing.close();
  for (const Numbers& set : take_all(pairing)) sets.push_back(set);
  REQUIRE(sets.size() == 18);
  for (const Numbers& set : sets) {
    CHECK(set.right == set.left);
    CHECK(set.fisheye == (set.left == 11 ? -1 : set.left));
  }
  CHECK(of(pairing.alone(), LiveCamera::kLeft) == 1);
  CHECK(of(pairing.alone(), LiveCamera::kRight) == 1);
  CHECK(of(pairing.alone(), LiveCamera::kFisheye) == 2);
  const auto notes = pairing.notes();
  REQUIRE(notes.size() == 1);
  CHECK_THAT(notes[0], Catch::Contains("15 ms later"));
}

TEST_CASE("Clocks that are seconds apart are refused") {
  PairingOptions options;
  options.stamps = StampKind::kSensor;
  SetPairing pairing(options);
  for (int i = 0; i < 20; ++i) {
    pairing.add(LiveCamera::kLeft, image(kStart + i * kPeriod, i));
    pairing.add(LiveCamera::kRight, image(kStart + i * kPeriod + 5000 * kMs, i));
  }
  CHECK_THROWS_WITH(pairing.take(), Catch::Contains("no times in common") &&
                                        Catch::Contains("the least difference is 1.2e+03 ms"));
}

TEST_CASE("Pairs go on without a fisheye that is away, and with it when it is back") {
  PairingOptions options;
  options.fisheye = true;
  SetPairing pairing(options);
  std::vector<Numbers> sets;
  for (int i = 0; i < 100; ++i) {
    const std::int64_t stamp = kStart + i * kPeriod;
    pairing.add(LiveCamera::kLeft, image(stamp, i));
    pairing.add(LiveCamera::kRight, image(stamp + kMs, i));
    if (i == 30) pairing.set_away(LiveCamera::kFisheye, true);
    if (i == 60) pairing.set_away(LiveCamera::kFisheye, false);
    if (i == 60) pairing.restart(LiveCamera::kFisheye);
    if (i < 30 || i >= 60) pairing.add(LiveCamera::kFisheye, image(stamp + 2 * kMs, i));
    const std::size_t before = sets.size();
    for (const Numbers& set : take_all(pairing)) sets.push_back(set);
    if (i > 20) CHECK(sets.size() == before + 1);  // nobody waits
  }
  for (const Numbers& set : sets) {
    CHECK(set.right == set.left);
    CHECK(set.fisheye == (set.left >= 30 && set.left < 60 ? -1 : set.left));
  }
}

TEST_CASE("Few images wait for a camera that does not answer") {
  PairingOptions options;
  options.most_waiting = 64;
  SetPairing pairing(options);
  pair_arrivals(arrivals(20, 0, 200, 0, 1), pairing);
  for (int i = 20; i < 1000; ++i) {
    pairing.add(LiveCamera::kLeft, image(kStart + i * kPeriod, i));
    CHECK_FALSE(pairing.take());
    CHECK(pairing.waiting(LiveCamera::kLeft) <= options.most_waiting);
  }
}

}  // namespace hybrid_slam
