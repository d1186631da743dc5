#include "apps/slam/session.h"

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstring>
#include <random>
#include <stdexcept>
#include <thread>
#include <vector>

#include "test/integration/simulated_runs.h"
#include "test/support/temp_folder.h"

namespace hybrid_slam {
namespace {

SlamOptions few_features() {
  SlamOptions options;
  options.features = 1000;
  options.distribute();
  return options;
}

SimulatedSource hybrid_source(int times) {
  SyntheticSceneOptions scene;
  scene.trajectory = SceneTrajectory::kHover;
  scene.times = times;
  scene.fisheye = true;
  return SimulatedSource(make_synthetic_scene(scene));
}

SessionOptions every_frame() {
  SessionOptions session;
  session.mode = SessionMode::kEveryFrame;
  return session;
}

std::vector<SensorInput> all_inputs(const SimulatedSource& source) {
  std::vector<SensorInput> inputs;
  for (std::size_t i = 0; i < source.size(); ++i) {
    for (SensorInput& input : source.read(i).inputs) inputs.push_back(std::move(input));
  }
  return inputs;
}

// What came out, in a form that can be compared bit by bit.
struct Outcome {
  std::vector<double> poses;
  std::string map;
};

Outcome push_all(const SimulatedSource& source, std::vector<SensorInput> inputs,
                 SessionOptions options) {
  Outcome outcome;
  SessionObservers observers;
  observers.frame = [&](const FrameResult& frame) {
    const auto& pose = frame.tracked.cam_from_world.params;
    outcome.poses.insert(outcome.poses.end(), pose.data(), pose.data() + 7);
  };
  Session session(source.cameras(), few_features(), std::move(options), observers);
  for (SensorInput& input : inputs) CHECK(session.push(std::move(input)) == PushResult::kTaken);
  session.finish();
  const TempFolder folder;
  session.save(folder.path() / "map.hslam");
  outcome.map = read_text(folder.path() / "map.hslam");
  return outcome;
}

bool same_bits(const Outcome& a, const Outcome& b) {
  return a.poses.size() == b.poses.size() && a.map == b.map &&
         std::memcmp(a.poses.data(), b.poses.data(), a.poses.size() * sizeof(double)) == 0;
}

TEST_CASE("Inputs shuffled within half a second give the same bits", "[slam]") {
  const SimulatedSource source = hybrid_source(30);
  const Outcome ordered = push_all(source, all_inputs(source), every_frame());
  CHECK(ordered.poses.size() == 30 * 2 * 7);
  for (unsigned seed = 0; seed < 2; ++seed) {
    std::mt19937 random(seed);
    std::vector<std::pair<Nanoseconds, SensorInput>> shuffled;
    for (SensorInput& input : all_inputs(source)) {
      const auto delay = static_cast<Nanoseconds>(random() % 499'000'000);
      shuffled.emplace_back(time_of(input) + delay, std::move(input));
    }
    std::stable_sort(shuffled.begin(), shuffled.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<SensorInput> inputs;
    for (auto& [when, input] : shuffled) inputs.push_back(std::move(input));
    SessionOptions threads = every_frame();
    threads.threads = 3;
    CHECK(same_bits(push_all(source, std::move(inputs), threads), ordered));
  }
}

TEST_CASE("Cameras of unequal rates and missing partners are tracked", "[slam]") {
  const SimulatedSource source = hybrid_source(30);
  std::vector<SensorInput> inputs;
  int kept = 0;
  for (SensorInput& input : all_inputs(source)) {
    const auto tenth = to_seconds(time_of(input)) * source.scene().options.frame_rate;
    const bool third = std::lround(tenth) % 3 == 0;
    if (camera_of(input) == CameraKind::kFisheye ? third : std::lround(tenth) != 7) {
      inputs.push_back(std::move(input));
      ++kept;
    }
  }
  const Outcome outcome = push_all(source, std::move(inputs), every_frame());
  CHECK(outcome.poses.size() == static_cast<std::size_t>(7 * kept));
  CHECK(kept == 39);
}

TEST_CASE("track() gives the frame's result at once", "[slam]") {
  const SimulatedSource source = hybrid_source(10);
  for (const SessionMode mode : {SessionMode::kEveryFrame, SessionMode::kRealtime}) {
    SessionOptions options;
    options.mode = mode;
    Session session(source.cameras(), few_features(), options);
    for (std::size_t i = 0; i < source.size(); ++i) {
      for (SensorInput& input : source.read(i).inputs) {
        const CameraKind camera = camera_of(input);
        const Nanoseconds time = time_of(input);
        const auto result = session.track(std::move(input));
        REQUIRE(result);
        CHECK(result->camera == camera);
        CHECK(result->time == time);
        const bool looked_for = camera == CameraKind::kFisheye && i == 0;
        CHECK(result->state == (looked_for ? TrackingState::kRelocalised : TrackingState::kMap));
        const SyntheticFrame& truth =
            camera == CameraKind::kStereo ? source.stereo_truth(i) : source.fisheye_truth(i);
        const auto pose = session.pose_at(camera, time);
        REQUIRE(pose);
        CHECK((origin_in_a(*pose) - origin_in_a(truth.cam_from_world)).norm() < 0.02);
      }
    }
    session.finish();
    CHECK(session.push(source.read(0).inputs.front()) == PushResult::kClosed);
  }
}

TEST_CASE("Poses are given between frames, landmarks by view, and a map to go on with", "[slam]") {
  const SimulatedSource source = hybrid_source(12);
  Session session(source.cameras(), few_features(), every_frame());
  for (SensorInput& input : all_inputs(source)) session.push(std::move(input));
  session.finish();
  const auto time = [&](double index) {
    return to_nanoseconds(index / source.scene().options.frame_rate);
  };
  const auto a = session.pose_at(CameraKind::kFisheye, time(4));
  const auto b = session.pose_at(CameraKind::kFisheye, time(5));
  const auto between = session.pose_at(CameraKind::kFisheye, time(4.5));
  REQUIRE((a && b && between));
  CHECK((origin_in_a(*between) - 0.5 * (origin_in_a(*a) + origin_in_a(*b))).norm() < 1e-9);
  CHECK(between->rotation().angularDistance(a->rotation()) ==
        Approx(a->rotation().angularDistance(b->rotation()) / 2));
  CHECK_FALSE(session.pose_at(CameraKind::kStereo, time(-1)));
  CHECK_FALSE(session.pose_at(CameraKind::kStereo, time(12)));

  const auto seen = session.landmarks_in_view(CameraKind::kStereo, Rigid3d());
  CHECK(seen.size() > 100);
  CHECK(seen.size() < session.map()->landmark_count());
  const Rigid3d turned(Eigen::Quaterniond(0, 0, 1, 0), Eigen::Vector3d::Zero());  // backwards
  CHECK(session.landmarks_in_view(CameraKind::kStereo, turned).size() < seen.size() / 10);

  const TempFolder folder;
  session.save(folder.path() / "map.hslam");
  SessionOptions localize = every_frame();
  localize.localize = true;
  localize.vocabulary = simulated_run(source).session.vocabulary;
  Session again(source.cameras(), few_features(), localize, {},
                load_map(folder.path() / "map.hslam").map);
  const auto found = again.track(source.read(3).inputs.front());
  REQUIRE(found);
  CHECK(found->state == TrackingState::kRelocalised);
  CHECK(again.map()->keyframe_count() == session.map()->keyframe_count());
}

TEST_CASE("What cannot be used is refused and counted", "[slam]") {
  const SimulatedSource source = hybrid_source(3);
  CameraRig stereo = source.cameras();
  stereo.fisheye.reset();
  Session session(stereo, few_features(), every_frame());
  const GrayImage image{stereo.stereo.width, stereo.stereo.height,
                        std::vector<std::uint8_t>(
                            static_cast<std::size_t>(stereo.stereo.width * stereo.stereo.height))};
  GrayImage narrow = image;
  --narrow.width;
  CHECK(session.push(StereoImages{0, image, narrow}) == PushResult::kWrongSize);
  CHECK(session.push(StereoImages{0, image, image, narrow}) == PushResult::kWrongSize);
  CHECK(session.push(FisheyeImage{0, image}) == PushResult::kNoCamera);
  CHECK(session.counts().stereo.refused == 2);
  CHECK(session.counts().fisheye.refused == 1);

  SlamOptions bad = few_features();
  bad.features = 3;
  CHECK_THROWS_AS(Session(stereo, bad), std::invalid_argument);
  SessionOptions localize;
  localize.localize = true;
  CHECK_THROWS_AS(Session(stereo, few_features(), localize), std::logic_error);
}

TEST_CASE("reset() begins another map", "[slam]") {
  const SimulatedSource source = hybrid_source(20);
  for (const SessionMode mode : {SessionMode::kEveryFrame, SessionMode::kRealtime}) {
    SessionOptions options;
    options.mode = mode;
    Session session(source.cameras(), few_features(), options);
    for (std::size_t i = 0; i < 20; ++i) {
      if (i == 10) session.reset();
      const auto result = session.track(source.read(i).inputs.front());
      REQUIRE(result);
      CHECK(result->has_pose());
      // The tenth frame is the new world's origin.
      if (i == 10) CHECK(origin_in_a(result->tracked.cam_from_world).norm() == 0);
    }
    session.finish();
    const auto origin = session.map()->origin();
    CHECK(session.map()->at(origin).observations->time ==
          Approx(10 / source.scene().options.frame_rate));
  }
}

TEST_CASE("A slow observer loses events, which are counted, and holds nobody up", "[slam]") {
  const SimulatedSource source = hybrid_source(4);
  std::atomic<bool> let_go = false;
  std::atomic<int> heard = 0;
  SessionObservers observers;
  observers.frame = [&](const FrameResult&) {
    while (!let_go) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ++heard;
  };
  SessionOptions options;
  options.drop = false;
  Session session(source.cameras(), few_features(), options, observers);
  constexpr int kFrames = 1200;
  for (int i = 0; i < kFrames; ++i) {
    auto input = std::get<ExtractedFrame>(source.read(0).inputs.front());
    input.time = i * 100'000'000LL;
    session.push(std::move(input));
  }
  while (session.counts().waiting > 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  const auto lost = session.counts().overruns;
  CHECK(lost >= kFrames - static_cast<int>(SessionObservers::kBacklog) - 2);
  let_go = true;
  session.finish();
  CHECK(heard + lost == kFrames);
}

TEST_CASE("What an observer throws ends the session, and is thrown on", "[slam]") {
  const SimulatedSource source = hybrid_source(10);
  for (const SessionMode mode : {SessionMode::kEveryFrame, SessionMode::kRealtime}) {
    SessionOptions options;
    options.mode = mode;
    options.drop = false;
    SessionObservers observers;
    observers.frame = [](const FrameResult& frame) {
      if (frame.index == 5) throw std::runtime_error("an observer's");
    };
    Session session(source.cameras(), few_features(), options, observers);
    const auto run = [&] {
      for (SensorInput& input : all_inputs(source)) session.push(std::move(input));
      session.finish();
    };
    CHECK_THROWS_WITH(run(), "an observer's");
  }
}

}  // namespace
}  // namespace hybrid_slam
