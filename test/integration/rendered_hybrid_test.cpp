// hybrid_slam on whole sequences that scene_renderer makes: minutes each, so all are [slow].
#include <algorithm>
#include <chrono>
#include <limits>
#include <set>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "apps/io/trajectory.h"
#include "test/apps/program_run.h"
#include "test/support/child_process.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

constexpr double kFoundAgainWithin = 2;  // [s]

struct RenderedRun {
  nlohmann::json summary;
  std::vector<double> times;  // of the frames
  std::set<int> unseeing;  // frames whose fisheye is blind or looks at ground unknown to the pair
  std::vector<bool> registered;  // one per frame, when it came

  int count_registered_seeing() const {
    int count = 0;
    for (std::size_t i = 0; i < times.size(); ++i) {
      count += registered[i] && !unseeing.contains(static_cast<int>(i)) ? 1 : 0;
    }
    return count;
  }
  int seeing() const { return static_cast<int>(times.size() - unseeing.size()); }
};

Outcome run_long(const std::string& program, const std::vector<std::string>& arguments,
                 const std::filesystem::path& folder) {
  return ChildProcess(program, arguments, folder).finish(std::chrono::minutes(30));
}

RenderedRun render_and_run(const std::string& preset, int seed) {
  const TempFolder folder;
  const Outcome rendered = run_long(SCENE_RENDERER,
                                    {"data", "--preset", preset, "--seed", std::to_string(seed),
                                     "--sequence", "set", "--resolution", "640x480", "--quiet"},
                                    folder.path());
  REQUIRE(rendered.code == 0);
  const Outcome tracked = run_long(
      HYBRID_SLAM, {"data", "--cameras", "hybrid", "--quiet", "--out", "out"}, folder.path());
  INFO(tracked.err);
  REQUIRE(tracked.code == 0);
  const auto sequence = folder.path() / "data/hybrid/set";
  RenderedRun run;
  run.summary = read_json(folder.path() / "out/summary.json");
  const auto fisheye = read_json(sequence / "scene.json").at("fisheye");
  for (const char* const why : {"blind_frames", "turned_away_frames"}) {
    for (const int frame : fisheye.at(why)) run.unseeing.insert(frame);
  }
  for (const StampedPose& pose : read_trajectory(sequence / "gt_fish_tum.txt").poses) {
    run.times.push_back(pose.time);
  }
  run.registered.assign(run.times.size(), false);
  for (const StampedPose& pose : read_trajectory(folder.path() / "out/fisheye_online.tum").poses) {
    const auto at = std::lower_bound(run.times.begin(), run.times.end(), pose.time - 1e-3);
    REQUIRE(at != run.times.end());
    run.registered[static_cast<std::size_t>(at - run.times.begin())] = true;
  }
  return run;
}

// How long after each time without sight the fisheye was found again [s].
std::vector<double> times_to_find(const RenderedRun& run) {
  std::vector<double> seconds;
  for (std::size_t i = 1; i < run.times.size(); ++i) {
    const int frame = static_cast<int>(i);
    if (run.unseeing.contains(frame) || !run.unseeing.contains(frame - 1)) continue;
    std::size_t found = i;
    while (found < run.times.size() && !run.registered[found]) ++found;
    seconds.push_back(found < run.times.size() ? run.times[found] - run.times[i]
                                               : std::numeric_limits<double>::infinity());
  }
  return seconds;
}

TEST_CASE("The fisheye is placed well on three rendered seafloors", "[slow]") {
  for (const int seed : {1, 2, 3}) {
    INFO("seed " << seed);
    const RenderedRun run = render_and_run("normal", seed);
    CHECK(run.summary.at("frames").at("tracked") == run.times.size());
    CHECK(run.count_registered_seeing() >= 0.99 * run.seeing());
    const auto& error = run.summary.at("fisheye").at("relative_pose_error");
    CHECK(error.at("translation_m").at("mean") <= 0.0014);
    CHECK(error.at("rotation_deg").at("mean") <= 0.11);
    CHECK(error.at("translation_m").at("max") < 0.1);
  }
}

TEST_CASE("A blinded fisheye is found again soon, and never placed wrongly", "[slow]") {
  int cases = 0, soon = 0;
  for (const int seed : {1, 2, 3}) {
    INFO("seed " << seed);
    const RenderedRun run = render_and_run("hard", seed);
    CHECK(run.summary.at("frames").at("tracked") >= 0.9 * static_cast<double>(run.times.size()));
    CHECK(run.summary.at("fisheye").at("relative_pose_error").at("translation_m").at("max") < 0.1);
    for (const double seconds : times_to_find(run)) {
      ++cases;
      soon += seconds <= kFoundAgainWithin ? 1 : 0;
    }
  }
  REQUIRE(cases >= 3);
  CHECK(soon >= 0.9 * cases);
}

}  // namespace
}  // namespace hybrid_slam
