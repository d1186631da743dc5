#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <numbers>

#include "test/integration/simulated_source.h"
#include "test/support/replays.h"

namespace hybrid_slam {
namespace {

SyntheticSceneOptions hover(int times) {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kHover;
  options.times = times;
  options.landmarks = 3000;
  options.fisheye = true;
  options.clutter = 100;
  return options;
}

SlamOptions slam_options() {
  SlamOptions options;
  options.features = 1000;
  options.distribute();
  return options;
}

struct Errors {
  double translation = 0;  // mean, of the fisheye's pose relative to the stereo pair's [m]
  double rotation = 0;     // [rad]
  int count = 0;
};

// The paper's measure, of all moments at which both cameras were tracked.
Errors relative_pose_errors(const RunResult& result, const SimulatedSource& source) {
  Errors errors;
  for (const FrameRecord& fisheye : result.fisheye_records) {
    const auto index = static_cast<std::size_t>(fisheye.frame.frame_index);
    const auto stereo =
        std::find_if(result.records.begin(), result.records.end(), [&](const FrameRecord& record) {
          return record.frame.frame_index == fisheye.frame.frame_index;
        });
    if (!fisheye.frame.tracked() || stereo == result.records.end() || !stereo->frame.tracked()) {
      continue;
    }
    const Rigid3d estimate =
        result.cam_from_world(*stereo) * inverse(result.cam_from_world(fisheye));
    const Rigid3d truth = source.stereo_truth(index).cam_from_world *
                          inverse(source.fisheye_truth(index).cam_from_world);
    errors.translation += (estimate.translation() - truth.translation()).norm();
    errors.rotation += estimate.rotation().angularDistance(truth.rotation());
    ++errors.count;
  }
  errors.translation /= errors.count;
  errors.rotation /= errors.count;
  return errors;
}

std::size_t count_keyframes(const RunResult& result, bool fisheye) {
  std::size_t count = 0;
  for (const KeyframeId id : result.map->keyframe_ids()) {
    count += (baseline(result.map->camera(result.map->at(id))) == 0) == fisheye ? 1 : 0;
  }
  return count;
}

}  // namespace

TEST_CASE("A fisheye that moves by itself is placed in the stereo pair's map", "[integration]") {
  const SimulatedSource source(make_synthetic_scene(hover(60)));
  const RunResult result = run_every_frame(source, slam_options(), {}, {});
  CHECK(result.frames.tracked == 60);
  CHECK(result.fisheye_frames.read == 60);
  CHECK(result.fisheye_frames.tracked == 60);
  const Errors errors = relative_pose_errors(result, source);
  CHECK(errors.count == 60);
  CHECK(errors.translation < 0.003);
  CHECK(errors.rotation < 0.1 * std::numbers::pi / 180);
  CHECK(count_keyframes(result, true) >= 2);  // in 6 s: the first, and one 5 s later
}

TEST_CASE("The fisheye adds keyframes and landmarks and costs the stereo path nothing",
          "[integration]") {
  const SimulatedSource hybrid(make_synthetic_scene(hover(60)));
  SyntheticScene without = hybrid.scene();
  without.cameras.pop_back();
  without.frames.clear();
  for (std::size_t i = 0; i < hybrid.size(); ++i) without.frames.push_back(hybrid.stereo_truth(i));
  const SimulatedSource stereo(std::move(without));
  const RunResult both = run_every_frame(hybrid, slam_options(), {}, {});
  const RunResult alone = run_every_frame(stereo, slam_options(), {}, {});
  CHECK(count_keyframes(both, true) >= 2);
  CHECK(both.map->landmark_count() > alone.map->landmark_count());
  double hybrid_error = 0;
  double stereo_error = 0;
  for (std::size_t i = 0; i < 60; ++i) {
    const Eigen::Vector3d truth = origin_in_a(hybrid.stereo_truth(i).cam_from_world);
    hybrid_error += (origin_in_a(both.cam_from_world(both.records[i])) - truth).norm() / 60;
    stereo_error += (origin_in_a(alone.cam_from_world(alone.records[i])) - truth).norm() / 60;
  }
  CHECK(hybrid_error < 1.2 * stereo_error + 0.0002);
}

TEST_CASE("A fisheye that was blind is found again at once, while stereo goes on",
          "[integration]") {
  SimulatedSource source(make_synthetic_scene(hover(40)));
  source.fisheye_blank = {15, 16, 17, 18};
  source.fisheye_missing = {25, 26};
  std::vector<std::string> warnings;
  ReplayHooks hooks;
  hooks.warning = [&](const std::string& line) { warnings.push_back(line); };
  const RunResult result = run_every_frame(source, slam_options(), {}, hooks);
  CHECK(result.frames.tracked == 40);
  CHECK(result.fisheye_frames.read == 40);
  CHECK(result.fisheye_frames.lost == 4);
  CHECK(result.fisheye_frames.corrupt == 2);
  CHECK(result.fisheye_frames.tracked == 34);
  REQUIRE(warnings.size() == 2);
  CHECK(warnings[0].find("frame 25: no fisheye image") != std::string::npos);
  CHECK(result.fisheye_records[19].frame.source == PoseSource::kRelocalization);
  CHECK(relative_pose_errors(result, source).translation < 0.003);
}

TEST_CASE("While the stereo pair is blind, the fisheye is still placed", "[integration]") {
  SimulatedSource source(make_synthetic_scene(hover(30)));
  source.blank = {12, 13, 14};
  const RunResult result = run_every_frame(source, slam_options(), {}, {});
  CHECK(result.frames.lost + result.frames.coasted == 3);
  CHECK(result.fisheye_frames.tracked == 30);
}

TEST_CASE("Hybrid runs repeat bit by bit, whatever the number of threads", "[integration]") {
  const SimulatedSource source(make_synthetic_scene(hover(20)));
  const auto poses = [&](int threads) {
    ReplayOptions run;
    run.session.threads = threads;
    const RunResult result = run_every_frame(source, slam_options(), run, {});
    std::vector<double> values;
    for (const auto* records : {&result.records, &result.fisheye_records}) {
      for (const FrameRecord& record : *records) {
        const Rigid3d pose = result.cam_from_world(record);
        values.insert(values.end(), pose.params.begin(), pose.params.end());
      }
    }
    return values;
  };
  const auto once = poses(1);
  const auto again = poses(3);
  REQUIRE(once.size() == again.size());
  CHECK(std::memcmp(once.data(), again.data(), once.size() * sizeof(double)) == 0);
}

TEST_CASE("realtime mode tracks both cameras", "[integration]") {
  const SimulatedSource source(make_synthetic_scene(hover(40)));
  ReplayOptions run;
  run.session.threads = 2;
  const RunResult result = run_realtime(source, slam_options(), run, {});
  CHECK(result.frames.tracked == 40);
  CHECK(result.fisheye_frames.tracked == 40);
  CHECK(relative_pose_errors(result, source).translation < 0.004);
}

}  // namespace hybrid_slam
