#include "apps/slam/mapping_worker.h"

#include <algorithm>
#include <numbers>
#include <stdexcept>
#include <utility>

#include <catch2/catch.hpp>

#include "apps/slam/channel.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kKnown = 10;  // keyframes in the map before
constexpr double kWrongPixels = 5;  // of all disparities

SyntheticScene corridor() {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kCorridor;
  options.times = kKnown + 6;
  options.landmarks = 1200;
  return make_synthetic_scene(options);
}

// A map of the first frames of a scene; the others can become keyframes.
struct Begun {
  SyntheticScene scene;
  std::size_t known;  // frames in the map before
  Vocabulary vocabulary = scene_vocabulary(scene);
  FilledMap filled;

  explicit Begun(SyntheticScene made = corridor(), std::size_t first = kKnown,
                 const FillOptions& fill = {})
      : scene(std::move(made)), known(first) {
    SyntheticScene part = scene;
    part.frames.resize(known);
    filled = fill_map(part, fill);
  }

  LocalMapping mapping() {
    SlamOptions options;
    options.culling.redundancy.observers = 1000;  // all keyframes stay
    return LocalMapping(options, std::move(filled.map));
  }

  // Of the i-th frame after those in the map.
  MappingJob job(std::size_t i, double disparity_offset = 0) const {
    const SyntheticFrame& frame = scene.frames[known + i];
    MappingJob job;
    job.keyframe.observations = frame.observations;
    job.keyframe.cam_from_world = frame.cam_from_world;
    for (const int landmark : frame.landmark) {
      job.keyframe.landmarks.push_back(
          landmark < 0 ? LandmarkId() : filled.landmarks[static_cast<std::size_t>(landmark)]);
    }
    job.keyframe.reference = filled.keyframes.back();
    job.reference_from_world = scene.frames[known - 1].cam_from_world;
    job.disparity_offset = disparity_offset;
    return job;
  }

  // The first keypoint that sees a landmark becomes one of another, which neither this job's frame
  // nor the next one's sees.
  static LandmarkId spoil(MappingJob& job, const MappingJob& next, const FilledMap& filled) {
    auto& seen = job.keyframe.landmarks;
    const auto& after = next.keyframe.landmarks;
    const auto in_sight = [&](LandmarkId id) {
      return std::count(seen.begin(), seen.end(), id) + std::count(after.begin(), after.end(), id) >
             0;
    };
    for (const LandmarkId other : filled.landmarks) {
      if (!other.valid() || in_sight(other)) continue;
      *std::find_if(seen.begin(), seen.end(), [](LandmarkId id) { return id.valid(); }) = other;
      return other;
    }
    throw std::logic_error("every landmark is in sight");
  }
};

using Told = std::pair<KeyframeResult, std::shared_ptr<const MapSnapshot>>;

// What mapping tells. Its thread waits where `hold` is told to, until it is let go.
struct Listener {
  std::vector<Told> mapped;
  std::vector<LoopOutcome> loops;
  std::vector<std::int64_t> newest_at_loops;  // frame of the newest keyframe
  Channel<int> holds{1};
  Channel<int> let_go{1};
  bool hold_first = false;
  bool fail_first = false;

  MappingEvents events() {
    MappingEvents events;
    events.mapped = [this](const KeyframeResult& keyframe,
                           const std::shared_ptr<const MapSnapshot>& map) {
      mapped.emplace_back(keyframe, map);
      if (mapped.size() > 1) return;
      if (hold_first) {
        holds.push(1);
        let_go.pop();
      }
      if (fail_first) throw std::runtime_error("a bug in mapping");
    };
    events.looped = [this](const LoopOutcome& outcome,
                           const std::shared_ptr<const MapSnapshot>& map, std::size_t) {
      loops.push_back(outcome);
      newest_at_loops.push_back(map->newest_frame_index(CameraId(0)));
    };
    events.adjusted = [](const std::shared_ptr<const MapSnapshot>&) {};
    return events;
  }
};

LoopMeasurement loop_of_none() {
  LoopMeasurement loop;
  loop.keyframe = KeyframeId(1000);
  loop.match = KeyframeId(0);
  return loop;
}

TEST_CASE("Keyframes that come while the map is optimised are optimised together", "[pipeline]") {
  Begun begun;
  MappingJob jobs[] = {begun.job(0), begun.job(1), begun.job(2), begun.job(3)};
  const LandmarkId wrong = Begun::spoil(jobs[2], jobs[3], begun.filled);
  LocalMapping mapping = begun.mapping();
  Listener listener;
  listener.hold_first = true;
  MappingWorker worker(mapping, begun.vocabulary, listener.events(), true);
  worker.add(jobs[0]);
  REQUIRE(listener.holds.pop());
  // Of what lies there when the thread goes on, an update of the first one begins at once; that it
  // has ended is told after the others have come.
  for (std::size_t i = 1; i < 4; ++i) worker.add(jobs[i]);
  listener.let_go.push(1);
  worker.finish();
  worker.rethrow();
  REQUIRE(listener.mapped.size() == 4);
  for (std::size_t i = 0; i < 4; ++i) CHECK(listener.mapped[i].first.id.value == kKnown + i);
  CHECK(listener.mapped[2].second == listener.mapped[3].second);
  CHECK(listener.mapped[1].second != listener.mapped[2].second);
  const MapSnapshot& map = mapping.map().view();
  CHECK(mapping.map().check_consistency() == std::vector<std::string>{});
  // What only the older one of the two sees was looked at, too.
  const auto& seen = map.at(KeyframeId(kKnown + 2)).landmarks;
  CHECK(std::count(seen.begin(), seen.end(), wrong) == 0);
  // The update was taken in: its covariances are in the map.
  REQUIRE(map.covariances() != nullptr);
  CHECK(map.covariances()->knows(KeyframeId(kKnown + 3)));
}

TEST_CASE("Who adds a keyframe learns that mapping has failed, however many wait", "[pipeline]") {
  Begun begun;
  std::vector<MappingJob> jobs;
  for (std::size_t i = 0; i < 5; ++i) jobs.push_back(begun.job(i));
  LocalMapping mapping = begun.mapping();
  for (const bool beside : {true, false}) {
    Listener listener;
    listener.hold_first = listener.fail_first = true;
    MappingWorker worker(mapping, begun.vocabulary, listener.events(), beside);
    worker.add(jobs[0]);
    REQUIRE(listener.holds.pop());
    std::size_t waiting = 1;
    while (worker.has_room()) worker.add(jobs[waiting++]);
    CHECK(waiting == 4);
    listener.let_go.push(1);
    std::size_t seen = worker.version();
    while (worker.wait_for_map(seen)) {
    }
    CHECK(worker.has_room());
    CHECK_FALSE(worker.add(jobs[4]));
    worker.finish();
    CHECK_THROWS_WITH(worker.rethrow(), "a bug in mapping");
    CHECK(listener.mapped.size() == 1);
  }
}

TEST_CASE("A loop that was found before the map changes size is closed before", "[pipeline]") {
  Begun begun;
  const MappingJob jobs[] = {begun.job(0), begun.job(1), begun.job(2, kWrongPixels)};
  LocalMapping mapping = begun.mapping();
  REQUIRE(mapping.moves_the_map(jobs[2]));
  Listener listener;
  listener.hold_first = true;
  MappingWorker worker(mapping, begun.vocabulary, listener.events(), true);
  worker.add(jobs[0]);
  REQUIRE(listener.holds.pop());
  worker.add(jobs[1]);
  worker.add(loop_of_none());  // waits until the update of the keyframe before has ended
  worker.add(jobs[2]);
  listener.let_go.push(1);
  worker.finish();
  worker.rethrow();
  REQUIRE(listener.loops.size() == 1);
  CHECK(listener.loops[0].end == LoopEnd::kGone);
  CHECK(listener.newest_at_loops[0] == jobs[1].frame_index());
  CHECK(listener.mapped.size() == 3);
  CHECK(mapping.map().check_consistency() == std::vector<std::string>{});
}

// A circle and a fifth, of which the map holds the last quarter aside and as another place.
struct OpenLap : Begun {
  static constexpr int kLap = 24;
  static constexpr std::size_t kSplit = 18;
  static inline const Rigid3d kAside{Eigen::Quaterniond::Identity(), {0.1, -0.05, 0.02}};

  OpenLap() : Begun(orbit(), kLap + 2, torn()) {}

  static SyntheticScene orbit() {
    SyntheticSceneOptions options;
    options.trajectory = SceneTrajectory::kOrbit;
    options.times = kLap + 6;
    options.step = 2 * std::numbers::pi * 3 / kLap;
    options.landmarks = 1500;
    return make_synthetic_scene(options);
  }
  static FillOptions torn() {
    FillOptions fill;
    fill.split = kSplit;
    fill.split_drift = Sim3d(kAside);
    return fill;
  }

  // As tracking finds the frame in the part that is aside.
  MappingJob job_aside(std::size_t i) const {
    MappingJob made = job(i);
    made.keyframe.cam_from_world = made.keyframe.cam_from_world * inverse(kAside);
    made.reference_from_world = made.reference_from_world * inverse(kAside);
    return made;
  }

  LoopMeasurement loop() const {
    LoopMeasurement loop;
    loop.keyframe = filled.keyframes[kLap + 1];
    loop.match = filled.keyframes[1];
    loop.keyframe_from_match =
        Sim3d(scene.frames[kLap + 1].cam_from_world * inverse(scene.frames[1].cam_from_world));
    for (const int index : scene.frames[kLap + 1].landmark) {
      const auto i = static_cast<std::size_t>(std::max(index, 0));
      const LandmarkMerge same{filled.first_landmarks[i], filled.landmarks[i]};
      if (index >= 0 && same.keep.valid() && same.drop.valid()) loop.same.push_back(same);
    }
    return loop;
  }

  double worst_error(const MapSnapshot& map) const {
    double worst = 0;
    for (const KeyframeId id : map.keyframe_ids()) {
      const Rigid3d& truth = scene.frames[id.value].cam_from_world;
      worst = std::max(worst, (origin_in_a(map.at(id).cam_from_world) - origin_in_a(truth)).norm());
    }
    return worst;
  }
};

TEST_CASE("Keyframes come while a loop is closed, and corrections", "[pipeline]") {
  for (const bool beside : {true, false}) {
    OpenLap lap;
    std::vector<MappingJob> jobs;
    for (std::size_t i = 0; i < 4; ++i) jobs.push_back(lap.job_aside(i));
    LocalMapping mapping = lap.mapping();
    Listener listener;
    MappingWorker worker(mapping, lap.vocabulary, listener.events(), beside);
    const double open = lap.worst_error(*worker.snapshot());
    CHECK(open > 0.1);
    const BundleResult adjusted = solve_full(*worker.snapshot(), {});
    worker.add(std::move(jobs[0]));
    worker.add(lap.loop());
    worker.add(std::move(jobs[1]));
    worker.add(std::move(jobs[2]));
    worker.add(FullCorrection{0, adjusted});  // from before the loop
    worker.add(std::move(jobs[3]));
    worker.finish();
    worker.rethrow();
    REQUIRE(listener.loops.size() == 1);
    CHECK(listener.loops[0].end == LoopEnd::kClosed);
    CHECK(worker.loops_adjusted() == 0);
    REQUIRE(listener.mapped.size() == 4);
    for (std::size_t i = 0; i < 4; ++i) CHECK(listener.mapped[i].first.id.value == lap.known + i);
    CHECK(mapping.map().check_consistency() == std::vector<std::string>{});
    mapping.conclude({});
    CHECK(lap.worst_error(mapping.map().view()) < 0.3 * open);
  }
}

TEST_CASE("What mapping was given is done before it ends, in order", "[pipeline]") {
  for (const bool beside : {true, false}) {
    Begun begun;
    std::vector<MappingJob> jobs;
    for (std::size_t i = 0; i < 6; ++i) jobs.push_back(begun.job(i));
    LocalMapping mapping = begun.mapping();
    Listener listener;
    MappingWorker worker(mapping, begun.vocabulary, listener.events(), beside);
    for (MappingJob& job : jobs) {
      CHECK(worker.add(std::move(job)));
      worker.add(loop_of_none());
    }
    worker.add(FullCorrection{0, solve_full(*worker.snapshot(), {})});
    worker.finish();
    worker.rethrow();
    CHECK(listener.loops.size() == 6);
    REQUIRE(listener.mapped.size() == 6);
    for (std::size_t i = 0; i < 6; ++i) {
      CHECK(listener.mapped[i].first.id.value == kKnown + i);
      CHECK(listener.mapped[i].second->find(listener.mapped[i].first.id) != nullptr);
    }
    const auto last = worker.snapshot();
    CHECK(last->keyframe_count() == kKnown + 6);
    REQUIRE(last->covariances() != nullptr);
    CHECK(last->covariances()->knows(KeyframeId(kKnown + 5)));
    CHECK_FALSE(worker.add(loop_of_none()));
  }
}

TEST_CASE("Mapping can be let go of while it optimises", "[pipeline]") {
  Begun begun;
  const MappingJob jobs[] = {begun.job(0), begun.job(1)};
  LocalMapping mapping = begun.mapping();
  Listener listener;
  {
    MappingWorker worker(mapping, begun.vocabulary, listener.events(), true);
    worker.add(jobs[0]);
    worker.add(jobs[1]);
  }
  CHECK(listener.mapped.size() == 2);
  // Nothing is under way: what an update that works keeps out is done.
  CHECK_NOTHROW(mapping.conclude({}));
}

}  // namespace
}  // namespace hybrid_slam
