#include "frontend/place_recognition/keyframe_database.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/allocation_watch.h"
#include "test/support/filled_map.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

struct Orbit {
  Orbit() {
    SyntheticSceneOptions options;
    options.times = 12;
    options.landmarks = 800;
    options.clutter = 20;
    scene = make_synthetic_scene(options);
    filled = fill_map(scene, {});
  }

  // The frame once more, as a keyframe that shares nothing.
  KeyframeId add(std::size_t frame) {
    NewKeyframe made;
    made.observations = scene.frames[frame].observations;
    made.landmarks.resize(made.observations->size());
    made.cam_from_world = scene.frames[frame].cam_from_world;
    made.reference = map().origin();
    return filled.map.add_keyframe(made);
  }

  void erase(const std::vector<KeyframeId>& keyframes) {
    MapEdit edit;
    edit.erased_keyframes = keyframes;
    filled.map.apply(edit);
  }

  const MapSnapshot& map() const { return filled.map.view(); }
  const FeatureSet& features(std::size_t frame) const {
    return scene.frames[frame].observations->features;
  }

  SyntheticScene scene;
  FilledMap filled;
};

// What a database that saw the map's history has to be: that of one which sees it for the first
// time.
void check_equal(const KeyframeDatabase& database, const KeyframeDatabase& fresh,
                 const Orbit& orbit) {
  REQUIRE(database.size() == fresh.size());
  for (std::size_t frame = 0; frame < orbit.scene.frames.size(); frame += 5) {
    const BowVector bow = fresh.words_of(orbit.features(frame)).bow;
    const auto found = database.similar(bow, 100, {}), expected = fresh.similar(bow, 100, {});
    REQUIRE(found.size() == expected.size());
    for (std::size_t i = 0; i < found.size(); ++i) {
      REQUIRE(found[i].keyframe == expected[i].keyframe);
      REQUIRE(found[i].shared_words == expected[i].shared_words);
    }
  }
  for (std::uint32_t i = 0; i < orbit.map().next_keyframe_id().value; ++i) {
    const KeyframeId id(i);
    REQUIRE(database.contains(id) == fresh.contains(id));
    if (!fresh.contains(id)) continue;
    REQUIRE(database.bow_of(id) == fresh.bow_of(id));
  }
}

TEST_CASE("A database of keyframes follows the map") {
  Orbit orbit;
  KeyframeDatabase places(scene_vocabulary(orbit.scene));
  places.follow(orbit.map());
  CHECK(places.size() == orbit.map().keyframe_count());
  const auto best = [&] {
    return places.similar(places.words_of(orbit.features(5)).bow, 1, {}).at(0).keyframe;
  };
  const KeyframeId before = best();
  CHECK(before == orbit.filled.keyframes[5]);
  CHECK(places.bow_of(before) == places.words_of(orbit.features(5)).bow);
  orbit.erase({before});
  places.follow(orbit.map());
  CHECK(places.size() == orbit.map().keyframe_count());
  CHECK(best() != before);
  CHECK(!places.contains(before));
  CHECK_THROWS_AS(places.bow_of(before), std::out_of_range);
}

TEST_CASE("A keyframe that goes while another comes is noticed") {
  Orbit orbit;
  KeyframeDatabase places(scene_vocabulary(orbit.scene));
  places.follow(orbit.map());
  const KeyframeId gone = orbit.filled.keyframes[5];
  orbit.erase({gone});
  const KeyframeId come = orbit.add(5);
  places.follow(orbit.map());
  CHECK(!places.contains(gone));
  CHECK(places.contains(come));
}

TEST_CASE("A database that follows a map through its history knows what a new one does") {
  Orbit orbit;
  const Vocabulary vocabulary = scene_vocabulary(orbit.scene);
  KeyframeDatabase places(vocabulary);
  Random random(3);
  std::vector<KeyframeId> alive = orbit.filled.keyframes;
  for (int step = 0; step < 60; ++step) {
    for (int i = random.integer(0, 2); i > 0; --i) {
      alive.push_back(orbit.add(random.below(orbit.scene.frames.size())));
    }
    for (int i = random.integer(0, 2); i > 0 && alive.size() > 4; --i) {
      const std::size_t index = 1 + random.below(alive.size() - 1);  // the origin stays
      orbit.erase({alive[index]});
      alive.erase(alive.begin() + static_cast<std::ptrdiff_t>(index));
    }
    if (random.uniform() < 0.3) continue;  // not followed: keyframes come and go unseen
    places.follow(orbit.map());
    KeyframeDatabase fresh(vocabulary);
    fresh.follow(orbit.map());
    check_equal(places, fresh, orbit);
  }
}

TEST_CASE("To follow a map that has nothing new costs nothing") {
  Orbit orbit;
  KeyframeDatabase places(scene_vocabulary(orbit.scene)), stranger(small_vocabulary());
  orbit.erase({orbit.filled.keyframes[5]});
  for (KeyframeDatabase* database : {&places, &stranger}) {
    database->follow(orbit.map());
    const AllocationWatch watch;
    database->follow(orbit.map());
    CHECK(watch.largest() == 0);
  }
}

TEST_CASE("Keyframes of a kind that the vocabulary does not know are no places") {
  Orbit orbit;
  KeyframeDatabase stranger(small_vocabulary());
  stranger.follow(orbit.map());
  orbit.erase({orbit.filled.keyframes[5]});
  stranger.follow(orbit.map());
  CHECK(stranger.size() == 0);
  CHECK(stranger.knows(DescriptorKind::kRootSift));
  CHECK(!stranger.knows(DescriptorKind::kSynthetic));
}

}  // namespace
}  // namespace hybrid_slam
