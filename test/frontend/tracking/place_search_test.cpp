// Lost frames found by the words of a vocabulary.
#include <algorithm>
#include <cstdlib>
#include <memory>

#include <catch2/catch.hpp>

#include "frontend/place_recognition/keyframe_database.h"
#include "frontend/tracking/stereo_tracker.h"
#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/frontend/pose/pose_scene.h"
#include "test/support/filled_map.h"
#include "test/support/frame_view.h"
#include "test/support/stereo_frame.h"

namespace hybrid_slam {
namespace {

constexpr int kTimes = 30;

// A circle, its map of every second frame, and a vocabulary of what is seen on it.
struct Circle {
  Circle() {
    SyntheticSceneOptions options;
    options.times = kTimes;
    options.landmarks = 3000;
    options.noise = 0.05;
    options.clutter = 50;
    scene = make_synthetic_scene(options);
    FillOptions fill;
    fill.stride = 2;
    filled = fill_map(scene, fill);
    places = std::make_shared<KeyframeDatabase>(scene_vocabulary(scene));
    places->follow(map());
  }

  const MapSnapshot& map() const { return filled.map.view(); }
  const FeatureSet& features(std::size_t frame) const {
    return scene.frames[frame].observations->features;
  }
  // How many frames lie between, the short way round.
  int steps_between(std::size_t frame, KeyframeId keyframe) const {
    const auto entry = std::find(filled.keyframes.begin(), filled.keyframes.end(), keyframe);
    REQUIRE(entry != filled.keyframes.end());
    const auto other = filled.frames[static_cast<std::size_t>(entry - filled.keyframes.begin())];
    const int steps = std::abs(static_cast<int>(frame) - static_cast<int>(other));
    return std::min(steps, kTimes - steps);
  }

  SyntheticScene scene;
  FilledMap filled;
  std::shared_ptr<KeyframeDatabase> places;
};

TEST_CASE("The keyframes most similar to an image are those beside it") {
  const Circle circle;
  CHECK(circle.places->size() == circle.map().keyframe_count());
  for (std::size_t frame = 1; frame < kTimes; frame += 4) {
    const ImageWords words = circle.places->words_of(circle.features(frame));
    const auto similar = circle.places->similar(words.bow, 2, {});
    REQUIRE(similar.size() == 2);
    for (const SimilarKeyframe& keyframe : similar) {
      CHECK(circle.steps_between(frame, keyframe.keyframe) <= 3);
    }
  }
}

TEST_CASE("Guided matches of a keyframe are nearly all that brute force finds") {
  const Circle circle;
  const KeyframeId keyframe = circle.filled.keyframes[5];  // frame 10
  const FeatureSet& features = circle.features(11);
  const auto all = match_keyframe(circle.map(), keyframe, features, 0.75, 0.7);
  const auto guided = match_keyframe_guided(
      circle.map(), keyframe, circle.places->index_of(circle.map().at(keyframe)), features,
      circle.places->words_of(features).index, 0.75, 0.7);
  REQUIRE(guided.size() == features.size());
  int found = 0, both = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    found += all[i].valid() ? 1 : 0;
    both += all[i].valid() && guided[i] == all[i] ? 1 : 0;
  }
  REQUIRE(found > 200);
  CHECK(both > 0.7 * found);
}

TEST_CASE("A lost stereo pair is found by words far from the newest keyframes") {
  const Circle circle;
  StereoTrackerOptions options;
  options.max_features = 800;
  options.relocalization.max_keyframes = 2;
  options.new_components = false;  // else the map would go on where nothing is recognised
  const auto& camera = std::get<Calibrated<RectifiedStereo>>(circle.scene.cameras.front());
  const auto tracked_from_nothing = [&](std::shared_ptr<const KeyframeDatabase> places) {
    StereoTracker tracker(CameraId(0), camera, options, std::move(places));
    return tracker.track(stereo_frame(circle.scene, 13), circle.map());
  };
  CHECK(!tracked_from_nothing(nullptr).tracked());
  const TrackedFrame found = tracked_from_nothing(circle.places);
  REQUIRE(found.source == PoseSource::kRelocalization);
  CHECK(pose_scene::translation_error(found.cam_from_world,
                                      circle.scene.frames[13].cam_from_world) < 0.003);
}

}  // namespace
}  // namespace hybrid_slam
