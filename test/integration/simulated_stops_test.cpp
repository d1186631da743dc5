// realtime mode stopped at any moment, with all its threads at work.
#include <catch2/catch.hpp>
#include <chrono>
#include <stop_token>
#include <thread>

#include "test/integration/simulated_runs.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

using Seconds = std::chrono::duration<double>;

// The end of a lap, to go on with a map of what comes before: the loop is met soon.
struct EndOfLap {
  EndOfLap() : source(make_synthetic_scene(scene())) {
    for (std::size_t i = 0; i < 53; ++i) source.order.push_back(i);
    map = first_part();
    source.order.clear();
    for (std::size_t i = 50; i < 78; ++i) source.order.push_back(i);
  }

  static SyntheticSceneOptions scene() {
    SyntheticSceneOptions options = orbit_of(78);
    options.noise = 0.5;
    options.landmarks = 3000;
    return options;
  }
  std::shared_ptr<const MapSnapshot> first_part() const {
    return run_every_frame(source, simulated_options(), simulated_run(source), {}).map;
  }

  SimulatedSource source;
  std::shared_ptr<const MapSnapshot> map;
};

// Starts and stops, by turns at a random frame and at a random time.
void start_and_stop(int cycles, std::uint64_t seed) {
  const EndOfLap lap;
  ReplayOptions run = simulated_run(lap.source);
  run.session.threads = 2;
  const auto start = std::chrono::steady_clock::now();
  const RunResult whole = run_realtime(lap.source, simulated_options(), run, {}, copy_of(*lap.map));
  const double seconds = Seconds(std::chrono::steady_clock::now() - start).count();
  CHECK_FALSE(whole.cancelled);
  CHECK(faults_of(*whole.map) == "");
  Random random(seed);
  int loops = 0;
  for (int i = 0; i < cycles; ++i) {
    const std::size_t last = 1 + random.below(lap.source.size());
    const Seconds after(random.uniform(0, 1.2 * seconds));
    const bool by_frame = i % 2 == 0;
    std::stop_source cancel;
    ReplayHooks hooks;
    hooks.cancelled = cancel.get_token();
    std::jthread canceller;
    if (by_frame) {
      hooks.progress = [&](const ReplayProgress& progress) {
        if (progress.done >= last) cancel.request_stop();
      };
    } else {
      canceller = std::jthread([&] {
        std::this_thread::sleep_for(after);
        cancel.request_stop();
      });
    }
    const RunResult result =
        run_realtime(lap.source, simulated_options(), run, hooks, copy_of(*lap.map));
    CAPTURE(i, by_frame, last, after.count());
    CHECK(faults_of(*result.map) == "");
    CHECK(result.internal_errors.empty());
    CHECK((result.cancelled || result.frames.read == static_cast<int>(lap.source.size())));
    for (const FrameRecord& record : result.records) {
      CHECK(result.cam_from_world(record).params.allFinite());
    }
    for (const LoopRecord& loop : result.loops) loops += loop.outcome == kLoopAccepted ? 1 : 0;
  }
  INFO("whole run " << seconds << " s, loops closed in " << cycles << " runs: " << loops);
  CHECK(loops >= cycles / 5);  // else these runs would show little
}

}  // namespace

TEST_CASE("realtime mode with loops ends whenever it is stopped", "[integration]") {
  start_and_stop(8, 1);
}

TEST_CASE("realtime mode with loops ends fifty times", "[integration][slow]") {
  start_and_stop(50, 2);
}

}  // namespace hybrid_slam
