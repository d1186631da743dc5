#include "frontend/mapping/fusion.h"

#include <catch2/catch.hpp>
#include <limits>
#include <unordered_map>

#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kNewest = 15;  // keyframe around which duplicates are looked for

SyntheticScene orbit_scene() {
  SyntheticSceneOptions options;
  options.times = 16;
  options.step = 0.4;
  options.clutter = 50;
  return make_synthetic_scene(options);
}

// A map that holds some landmarks twice: once as the older keyframes saw them, once as the newer
// ones did.
struct Duplicated {
  Duplicated() {
    std::vector<NewLandmark> second;
    MapEdit cut;
    for (std::size_t i = 0; i < filled.landmarks.size(); ++i) {
      const Landmark* landmark = filled.map.view().find(filled.landmarks[i]);
      if (landmark == nullptr) continue;
      truth[landmark->id] = i;
      if (i % 4 == 0) split(*landmark, cut, second);
    }
    filled.map.apply(cut);
    MapEdit births;
    births.new_landmarks = second;
    filled.map.apply(births);
    for (const NewLandmark& landmark : second) {
      const Observation& at = landmark.observations.front();
      const LandmarkId id = filled.map.view().at(at.keyframe).landmarks[at.keypoint];
      const int original = scene.frames[at.keyframe.value].landmark[at.keypoint];
      REQUIRE(id.valid());
      truth[id] = static_cast<std::size_t>(original);
      duplicates.emplace_back(filled.landmarks[static_cast<std::size_t>(original)], id);
    }
  }

  void split(const Landmark& landmark, MapEdit& cut, std::vector<NewLandmark>& second) const {
    NewLandmark newer{landmark.point_in_world, {}};
    std::size_t older = 0;
    for (const Observation& observation : landmark.observations) {
      if (observation.keyframe.value >= 13) {
        newer.observations.push_back(observation);
      } else {
        ++older;
      }
    }
    if (older < 2 || newer.observations.size() < 2 ||
        newer.observations.back().keyframe != filled.keyframes[kNewest]) {
      return;
    }
    for (const Observation& observation : newer.observations) {
      cut.erased_observations.push_back({landmark.id, observation});
    }
    second.push_back(newer);
  }

  SyntheticScene scene = orbit_scene();
  FilledMap filled = fill_map(scene, {});
  std::unordered_map<LandmarkId, std::size_t> truth;  // the scene's landmark of each of the map's
  std::vector<std::pair<LandmarkId, LandmarkId>> duplicates;  // older, newer
};

TEST_CASE("Landmarks that the map holds twice are merged, and no others") {
  Duplicated made;
  REQUIRE(made.duplicates.size() > 20);
  const MapSnapshot& map = made.filled.map.view();
  const MapEdit edit = fuse_with_neighbours(map, made.filled.keyframes[kNewest], {});
  REQUIRE(!edit.merged.empty());
  for (const LandmarkMerge& merge : edit.merged) {
    CHECK(made.truth.at(merge.keep) == made.truth.at(merge.drop));
    CHECK(map.at(merge.keep).observations.size() >= map.at(merge.drop).observations.size());
  }
  for (const LandmarkObservation& added : edit.new_observations) {
    const Observation& at = added.observation;
    const int shown = made.scene.frames[at.keyframe.value].landmark[at.keypoint];
    CHECK(shown == static_cast<int>(made.truth.at(added.landmark)));
  }
  made.filled.map.apply(edit);
  CHECK(made.filled.map.check_consistency().empty());
  int left = 0;
  for (const auto& [older, newer] : made.duplicates) {
    left += map.find(older) != nullptr && map.find(newer) != nullptr ? 1 : 0;
  }
  CHECK(left < 0.1 * static_cast<double>(made.duplicates.size()));
}

TEST_CASE("A map without duplicates stays as it is") {
  const SyntheticScene scene = orbit_scene();
  const FilledMap filled = fill_map(scene, {});
  const MapEdit edit = fuse_with_neighbours(filled.map.view(), filled.keyframes[kNewest], {});
  CHECK(edit.merged.empty());
}

TEST_CASE("A keypoint that shows a known landmark becomes an observation of it") {
  const SyntheticScene scene = orbit_scene();
  FilledMap filled = fill_map(scene, {});
  MapEdit cut;
  for (std::size_t i = 0; i < filled.landmarks.size(); i += 3) {
    const Landmark* landmark = filled.map.view().find(filled.landmarks[i]);
    if (landmark == nullptr || landmark->observations.size() < 4 ||
        landmark->observations.back().keyframe != filled.keyframes[kNewest]) {
      continue;
    }
    cut.erased_observations.push_back({landmark->id, landmark->observations.back()});
  }
  REQUIRE(cut.erased_observations.size() > 20);
  filled.map.apply(cut);
  filled.map.apply(fuse_with_neighbours(filled.map.view(), filled.keyframes[kNewest], {}));
  int back = 0;
  for (const LandmarkObservation& erased : cut.erased_observations) {
    const auto& landmarks = filled.map.view().at(erased.observation.keyframe).landmarks;
    back += landmarks[erased.observation.keypoint] == erased.landmark ? 1 : 0;
  }
  CHECK(back > 0.85 * static_cast<double>(cut.erased_observations.size()));
}

TEST_CASE("Two landmarks at the same place that look different are not merged") {
  Duplicated made;
  FusionOptions strict;
  strict.max_descriptor_distance = 0.01;  // below the noise of the descriptors
  CHECK(fuse_with_neighbours(made.filled.map.view(), made.filled.keyframes[kNewest], strict)
            .merged.empty());
}

TEST_CASE("FusionOptions out of range are refused") {
  CHECK(FusionOptions().validate().empty());
  const auto refused = [](auto set) {
    for (const double value : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
      FusionOptions options;
      set(options, value);
      CHECK(!options.validate().empty());
    }
  };
  refused([](auto& options, double value) { options.radius = value; });
  refused([](auto& options, double value) { options.max_descriptor_distance = value; });
  refused([](auto& options, double value) { options.max_scale_ratio = value; });
  refused([](auto& options, double value) { options.chi2_mono = value; });
}

}  // namespace
}  // namespace hybrid_slam
