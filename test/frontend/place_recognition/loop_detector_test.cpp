// A circle flown twice, whose second lap shares no landmarks with the first; and frames of it
// between those of another place.
#include "frontend/place_recognition/loop_detector.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <numbers>
#include <utility>

#include <catch2/catch.hpp>

#include "backend/map/covisibility.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kLap = 24;

SyntheticScene two_laps(std::uint64_t seed, bool fisheye = false) {
  SyntheticSceneOptions options;
  options.times = 2 * kLap;
  options.step = 2 * std::numbers::pi * 3 / kLap;
  options.landmarks = fisheye ? 1000 : 1500;
  options.clutter = 50;
  options.fisheye = fisheye;
  options.seed = seed;
  return make_synthetic_scene(options);
}

const SyntheticFrame& frame_of(const SyntheticScene& scene, CameraId camera, std::size_t time) {
  return scene.frames[time * scene.cameras.size() + camera.value];
}

// A scene of frames of others, in the order in which they are added.
class Film {
 public:
  explicit Film(const std::vector<Camera>& cameras) { scene_.cameras = cameras; }

  // From here on, landmarks are others than those before, though they look the same.
  void cut() { offset_ = next_; }

  void add(const SyntheticScene& from, CameraId camera, std::size_t time) {
    SyntheticFrame frame = frame_of(from, camera, time);
    const std::size_t end = offset_ + from.points_in_world.size();
    if (scene_.points_in_world.size() < end) scene_.points_in_world.resize(end);
    next_ = std::max(next_, end);
    for (std::size_t k = 0; k < frame.landmark.size(); ++k) {
      if (frame.landmark[k] < 0) continue;
      const auto point = static_cast<std::size_t>(frame.landmark[k]);
      scene_.points_in_world[offset_ + point] = from.points_in_world[point];
      frame.landmark[k] = static_cast<int>(offset_ + point);
    }
    auto observations = std::make_shared<FrameObservations>(*frame.observations);
    observations->frame_index = static_cast<std::int64_t>(scene_.frames.size());
    frame.observations = std::move(observations);
    scene_.frames.push_back(std::move(frame));
  }

  void add(const SyntheticScene& from, CameraId camera, std::size_t first, std::size_t last) {
    for (std::size_t time = first; time < last; ++time) add(from, camera, time);
  }

  const SyntheticScene& scene() const { return scene_; }

 private:
  SyntheticScene scene_;
  std::size_t offset_ = 0, next_ = 0;
};

constexpr CameraId kStereo{0}, kFisheye{1};

// Some 250 features and 512 words: the scores of unrelated images scatter more than real ones do.
LoopDetectorOptions coarse() {
  LoopDetectorOptions options;
  options.min_base_ratio = 1.5;
  return options;
}

// The map of a film: keyframe i is its frame i.
struct Place {
  explicit Place(const SyntheticScene& scene)
      : filled(fill_map(scene, {})), places(scene_vocabulary(scene)) {
    places.follow(map());
  }

  // The candidates of each keyframe, of those from `first` on.
  std::vector<std::vector<KeyframeId>> detect_all(const LoopDetectorOptions& options,
                                                  std::uint32_t first = 0) const {
    LoopDetector detector(options);
    std::vector<std::vector<KeyframeId>> found(first);
    for (std::uint32_t i = first; i < map().next_keyframe_id().value; ++i) {
      found.push_back(detector.detect(map(), places, KeyframeId(i)));
    }
    return found;
  }

  // Of the first lap, to a keyframe of the second.
  KeyframeId most_similar(std::size_t keyframe) const {
    std::vector<KeyframeId> second_lap;
    for (std::uint32_t i = kLap; i < 2 * kLap; ++i) second_lap.emplace_back(i);
    return places.similar(places.bow_of(second_lap[keyframe - kLap]), 1, second_lap).at(0).keyframe;
  }

  // The database does not know yet.
  void erase(const std::vector<KeyframeId>& keyframes) {
    MapEdit edit;
    edit.erased_keyframes = keyframes;
    filled.map.apply(edit);
  }

  const MapSnapshot& map() const { return filled.map.view(); }

  FilledMap filled;
  KeyframeDatabase places;
};

Place laps_of(CameraId first, CameraId second) {
  const SyntheticScene circle = two_laps(1, first == kFisheye || second == kFisheye);
  Film film(circle.cameras);
  film.add(circle, first, 0, kLap);
  film.cut();
  film.add(circle, second, kLap, 2 * kLap);
  return Place(film.scene());
}

std::size_t steps_between(std::size_t a, std::size_t b) {
  const std::size_t steps = (a + 2 * kLap - b) % kLap;
  return std::min(steps, kLap - steps);
}

// Keyframes of the second lap with a candidate beside them in the first.
std::size_t found_again(const std::vector<std::vector<KeyframeId>>& found) {
  std::size_t count = 0;
  for (std::size_t i = kLap; i < 2 * kLap; ++i) {
    count += std::any_of(found[i].begin(), found[i].end(), [&](KeyframeId id) {
      return id.value < kLap && steps_between(i, id.value) <= 2;
    });
  }
  return count;
}

TEST_CASE("A second lap finds the first, and the first finds nothing") {
  const Place place = laps_of(kStereo, kStereo);
  for (const int consistency : {1, 3}) {
    LoopDetectorOptions options = coarse();
    options.consistency = consistency;
    const auto found = place.detect_all(options);
    CHECK(found_again(found) == kLap + 1 - static_cast<std::size_t>(consistency));
    for (std::size_t i = 0; i < kLap; ++i) CHECK(found[i].empty());
  }
}

TEST_CASE("The best candidate is the nearest one") {
  const Place place = laps_of(kStereo, kStereo);
  const auto found = place.detect_all(coarse());
  for (std::size_t i = kLap; i < 2 * kLap; ++i) {
    REQUIRE(!found[i].empty());
    CHECK(steps_between(i, found[i].front().value) == 0);
  }
}

// The best candidate of each keyframe of the second lap shows half of what the keyframe does, or
// the other way round. The fisheye sees most of the circle, so steps say little.
void check_common_points(CameraId first, CameraId second) {
  const SyntheticScene circle = two_laps(1, true);
  const auto points = [&](CameraId camera, std::size_t time) {
    std::vector<int> seen = frame_of(circle, camera, time).landmark;
    std::erase(seen, -1);
    std::sort(seen.begin(), seen.end());
    return seen;
  };
  const Place place = laps_of(first, second);
  const auto found = place.detect_all({});
  std::size_t most_similar = 0;  // one can lie in another group than the best one
  for (std::size_t i = kLap; i < 2 * kLap; ++i) {
    REQUIRE(!found[i].empty());
    most_similar += found[i][0] == place.most_similar(i) ? 1 : 0;
    const std::vector<int> here = points(second, i), there = points(first, found[i][0].value);
    std::vector<int> common;
    std::set_intersection(here.begin(), here.end(), there.begin(), there.end(),
                          std::back_inserter(common));
    CHECK(2 * common.size() > std::min(here.size(), there.size()));
  }
  CHECK(most_similar + 1 >= kLap);
}

TEST_CASE("The fisheye finds what the stereo pair saw") { check_common_points(kStereo, kFisheye); }

TEST_CASE("The stereo pair finds what the fisheye saw") { check_common_points(kFisheye, kStereo); }

TEST_CASE("A large group of unrelated keyframes does not outweigh a lone one of the place") {
  const SyntheticScene circle = two_laps(1), elsewhere = two_laps(2);
  Film film(circle.cameras);
  film.add(circle, kStereo, 5);  // alone
  film.cut();
  film.add(elsewhere, kStereo, 0, kLap);
  film.cut();
  film.add(circle, kStereo, kLap + 6);
  const Place place(film.scene());
  LoopDetectorOptions options;  // the accumulated score alone decides
  options.min_word_share = 0;
  options.min_base_ratio = 1;
  const auto found = place.detect_all(options).back();
  REQUIRE(!found.empty());
  CHECK(found.front() == KeyframeId(0));
}

TEST_CASE("Candidates are of different places and not too many") {
  const Place place = laps_of(kStereo, kStereo);
  LoopDetectorOptions options = coarse();
  options.min_base_ratio = 1;
  options.min_score_share = 0;
  options.min_word_share = 0;
  std::size_t most = 0;
  for (const auto& candidates : place.detect_all(options)) {
    most = std::max(most, candidates.size());
    for (const KeyframeId a : candidates) {
      for (const KeyframeId b : candidates) {
        CHECK(shared_landmarks(place.map().at(a), b) < 15);
      }
    }
  }
  CHECK(most > 1);
  CHECK(most <= 3);
  options.max_candidates = 1;
  for (const auto& candidates : place.detect_all(options)) CHECK(candidates.size() <= 1);
}

TEST_CASE("What is connected is no candidate") {
  const SyntheticScene circle = two_laps(1);
  const Place place(circle);  // the second lap sees the landmarks of the first
  LoopDetectorOptions options = coarse();
  options.min_base_ratio = 1;
  const auto found = place.detect_all(options);
  CHECK(found_again(found) == 0);
  std::size_t proposed = 0;
  for (std::uint32_t i = 0; i < 2 * kLap; ++i) {
    for (const KeyframeId candidate : found[i]) {
      CHECK(shared_landmarks(place.map().at(KeyframeId(i)), candidate) < 15);
      ++proposed;
    }
  }
  CHECK(proposed > 0);
  options.max_shared_landmarks = 1000000;
  CHECK(found_again(place.detect_all(options)) == kLap);
}

TEST_CASE("The ends of a loop are far enough from one another") {
  const Place place = laps_of(kStereo, kStereo);
  LoopDetectorOptions options = coarse();
  options.min_gap = static_cast<int>(kLap);
  auto found = place.detect_all(options);
  for (std::uint32_t i = 0; i < 2 * kLap; ++i) {
    for (const KeyframeId candidate : found[i]) CHECK(candidate.value + kLap <= i);
  }
  CHECK(std::count(found[kLap + 5].begin(), found[kLap + 5].end(), KeyframeId(5)) == 1);
  options.min_gap = 2 * static_cast<int>(kLap);
  found = place.detect_all(options);
  CHECK(std::all_of(found.begin(), found.end(), [](const auto& f) { return f.empty(); }));
}

TEST_CASE("One keyframe that looks like an old one is not enough where more are asked for") {
  const SyntheticScene circle = two_laps(1), elsewhere = two_laps(2);
  Film film(circle.cameras);
  film.add(circle, kStereo, 0, kLap);
  film.cut();
  film.add(elsewhere, kStereo, 0, 5);
  film.cut();
  film.add(circle, kStereo, kLap + 5);  // alone
  film.cut();
  film.add(elsewhere, kStereo, 5, 10);
  film.cut();
  film.add(circle, kStereo, kLap + 15);  // followed by
  film.add(circle, kStereo, kLap + 16);  // its neighbour
  const Place place(film.scene());
  const std::size_t alone = kLap + 5, pair = alone + 6;
  LoopDetectorOptions options = coarse();
  auto found = place.detect_all(options);
  CHECK(found[alone].size() == 1);
  CHECK(found[pair].size() == 1);
  options.consistency = 2;
  found = place.detect_all(options);
  CHECK(found[alone].empty());
  CHECK(found[pair].empty());
  REQUIRE(found[pair + 1].size() == 1);
  CHECK(steps_between(16, found[pair + 1].front().value) <= 1);
}

TEST_CASE("Two keyframes that look like two old places are not consistent") {
  const SyntheticScene one = two_laps(1), other = two_laps(2);
  Film film(one.cameras);
  for (const std::size_t first :
       {std::size_t{0}, kLap}) {  // the first lap of both, then the second
    for (const SyntheticScene* circle : {&one, &other}) {
      film.add(*circle, kStereo, first, first == 0 ? 12 : first + 1);
      film.cut();
    }
  }
  const Place place(film.scene());
  LoopDetectorOptions options = coarse();
  auto found = place.detect_all(options);
  CHECK(found[kLap] == std::vector<KeyframeId>{KeyframeId(0)});
  CHECK(found[kLap + 1] == std::vector<KeyframeId>{KeyframeId(12)});
  options.consistency = 2;
  found = place.detect_all(options);
  CHECK(found[kLap].empty());
  CHECK(found[kLap + 1].empty());
}

TEST_CASE("Each camera counts for itself") {
  const SyntheticScene circle = two_laps(1, true), elsewhere = two_laps(2, true);
  Film film(circle.cameras);
  film.add(circle, kStereo, 0, kLap);
  film.cut();
  film.add(circle, kStereo, kLap + 5);
  film.add(circle, kFisheye, kLap + 5);  // sees it too, for the first time
  film.cut();
  film.add(elsewhere, kFisheye, 7);  // does not disturb
  film.cut();
  film.add(circle, kStereo, kLap + 6);
  const Place place(film.scene());
  LoopDetectorOptions options;  // the fisheye sees much that others do not
  auto found = place.detect_all(options, kLap);
  CHECK(!found[kLap].empty());
  CHECK(!found[kLap + 1].empty());
  options.consistency = 2;
  found = place.detect_all(options, kLap);
  CHECK(found[kLap].empty());
  CHECK(found[kLap + 1].empty());
  REQUIRE(found[kLap + 3].size() == 1);
  CHECK(steps_between(6, found[kLap + 3].front().value) <= 1);
}

TEST_CASE("Keyframes erased meanwhile are no candidates and do no harm") {
  Place place = laps_of(kStereo, kStereo);
  LoopDetectorOptions options = coarse();
  options.consistency = 2;
  LoopDetector detector(options);
  const auto detect = [&](std::uint32_t keyframe) {
    return detector.detect(place.map(), place.places, KeyframeId(keyframe));
  };
  detect(kLap + 5);
  const auto before = detect(kLap + 6);
  REQUIRE(!before.empty());
  place.erase({before.front()});
  const auto unnoticed = detect(kLap + 6);
  REQUIRE(!unnoticed.empty());
  CHECK(std::count(unnoticed.begin(), unnoticed.end(), before.front()) == 0);
  place.places.follow(place.map());
  const auto after = detect(kLap + 7);
  REQUIRE(!after.empty());
  CHECK(after.front() != before.front());
  CHECK(steps_between(7, after.front().value) <= 2);
  place.erase({KeyframeId(kLap + 8)});
  place.places.follow(place.map());
  CHECK(detect(kLap + 8).empty());

  std::vector<KeyframeId> first_lap;
  for (std::uint32_t i = 1; i < kLap; ++i) first_lap.emplace_back(i);
  place.erase(first_lap);  // all members of all groups
  place.places.follow(place.map());
  CHECK(detect(kLap + 9).empty());
  CHECK(detect(kLap + 10).empty());
}

TEST_CASE("A keyframe that the vocabulary does not know has no candidates") {
  const Place place = laps_of(kStereo, kStereo);
  KeyframeDatabase other(small_vocabulary());
  other.follow(place.map());
  LoopDetector detector({});
  CHECK(detector.detect(place.map(), other, KeyframeId(kLap + 5)).empty());
}

TEST_CASE("The same keyframes give the same candidates") {
  const Place place = laps_of(kStereo, kStereo);
  CHECK(place.detect_all({}) == laps_of(kStereo, kStereo).detect_all({}));
}

TEST_CASE("Options of the loop detector that cannot be used are refused") {
  CHECK(LoopDetectorOptions{}.validate().empty());
  const auto refused = [](auto set) {
    LoopDetectorOptions options;
    set(options);
    CHECK(!options.validate().empty());
    CHECK_THROWS_AS(LoopDetector(options), std::logic_error);
  };
  refused([](auto& o) { o.min_gap = 0; });
  refused([](auto& o) { o.max_shared_landmarks = 0; });
  refused([](auto& o) { o.min_word_share = 1.1; });
  refused([](auto& o) { o.min_base_ratio = 0.9; });
  refused([](auto& o) { o.min_score_share = -0.1; });
  refused([](auto& o) { o.consistency = 0; });
  refused([](auto& o) { o.max_candidates = 0; });
}

}  // namespace
}  // namespace hybrid_slam
