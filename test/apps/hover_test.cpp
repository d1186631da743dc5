// A vehicle that hovers for an hour and more: nothing may grow.
#include <malloc.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>

#include "apps/slam/session.h"
#include "test/integration/simulated_source.h"

namespace hybrid_slam {
namespace {

constexpr int kPositions = 20;  // there and back again, over ground that is mapped

// What the process holds [MB], without what malloc keeps for later.
double resident_mb() {
  malloc_trim(0);
  std::size_t size = 0;
  std::size_t resident = 0;
  std::ifstream("/proc/self/statm") >> size >> resident;
  return static_cast<double>(resident) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

std::size_t position(int frame) {
  const int phase = frame % (2 * kPositions - 2);
  return static_cast<std::size_t>(phase < kPositions ? phase : 2 * kPositions - 2 - phase);
}

TEST_CASE("Memory does not grow while the vehicle hovers", "[slam][slow]") {
  SyntheticSceneOptions scene;
  scene.trajectory = SceneTrajectory::kHover;
  scene.times = kPositions;
  scene.fisheye = true;
  scene.landmarks = 600;
  const SimulatedSource source(make_synthetic_scene(scene));
  SlamOptions slam;
  slam.features = 400;
  slam.distribute();
  for (const SessionMode mode : {SessionMode::kEveryFrame, SessionMode::kRealtime}) {
    SessionOptions options;
    options.mode = mode;
    options.drop = false;
    int tracked = 0;
    SessionObservers observers;
    observers.frame = [&](const FrameResult& frame) { tracked += frame.has_pose() ? 1 : 0; };
    Session session(source.cameras(), slam, options, observers);
    double early = 0;
    for (int i = 0; i < 20'000; ++i) {
      for (SensorInput& input : source.read(position(i)).inputs) {
        auto& frame = std::get<ExtractedFrame>(input);
        frame.time = i * 200'000'000LL;
        session.push(std::move(frame));
      }
      if (i == 2'000) early = resident_mb();
    }
    const double late = resident_mb();
    INFO((mode == SessionMode::kEveryFrame ? "every-frame: " : "realtime: ")
         << early << " MB after 2,000 frames, " << late << " MB after 20,000, "
         << session.map()->keyframe_count() << " keyframes");
    CHECK(late - early <= 5);
    session.finish();
    CHECK(tracked == 2 * 20'000);
    WARN(early << " -> " << late << " MB");
  }
}

}  // namespace
}  // namespace hybrid_slam
