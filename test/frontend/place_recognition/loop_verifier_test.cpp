// A circle flown twice, whose second lap is a part of the map of its own, misplaced.
#include "frontend/place_recognition/loop_verifier.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <set>

#include <catch2/catch.hpp>

#include "test/frontend/place_recognition/sample_vocabulary.h"
#include "test/support/filled_map.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

constexpr std::size_t kLaps = 24;  // keyframes of one

SyntheticScene circle_twice(bool fisheye = false) {
  SyntheticSceneOptions options;
  options.times = 2 * kLaps;
  options.step = 2 * std::numbers::pi * 3 / kLaps;
  options.landmarks = 3000;
  options.noise = 0.1;
  options.clutter = 50;
  options.fisheye = fisheye;
  return make_synthetic_scene(options);
}

Sim3d drift(double scale) { return {so3_exp({0.03, -0.06, 0.05}), {0.4, -0.3, 0.1}, scale}; }

struct TwoParts {
  explicit TwoParts(SyntheticScene made, double scale = 1) : scene(std::move(made)) {
    FillOptions fill;
    fill.split = kLaps;
    fill.split_drift = drift(scale);
    filled = fill_map(scene, fill);
    places = std::make_unique<KeyframeDatabase>(scene_vocabulary(scene));
    places->follow(map());
  }

  const MapSnapshot& map() const { return filled.map.view(); }

  LoopVerification verify(std::size_t newer, std::size_t older,
                          const LoopVerifierOptions& options = {}) const {
    return LoopVerifier(options).verify(map(), filled.keyframes[newer], filled.keyframes[older],
                                        *places);
  }

  Rigid3d true_motion(std::size_t newer, std::size_t older) const {
    return scene.frames[newer].cam_from_world * inverse(scene.frames[older].cam_from_world);
  }

  // The scene's landmark that a landmark of the map is.
  int scene_landmark(LandmarkId id) const {
    const auto& all = filled.landmarks;
    const auto& first = filled.first_landmarks;
    const auto in_second = std::find(all.begin(), all.end(), id);
    if (in_second != all.end()) return static_cast<int>(in_second - all.begin());
    return static_cast<int>(std::find(first.begin(), first.end(), id) - first.begin());
  }

  SyntheticScene scene;
  FilledMap filled;
  std::unique_ptr<KeyframeDatabase> places;
};

// What the second lap sees of landmarks that `alike` does not name looks like nothing known.
template <typename Alike>
SyntheticScene with_other_surroundings(SyntheticScene scene, const Alike& alike) {
  Random random(8);
  std::map<int, Descriptor> others;
  for (std::size_t i = kLaps; i < scene.frames.size(); ++i) {
    auto observations = std::make_shared<FrameObservations>(*scene.frames[i].observations);
    for (std::size_t k = 0; k < scene.frames[i].landmark.size(); ++k) {
      const int landmark = scene.frames[i].landmark[k];
      if (landmark < 0 || alike(landmark)) continue;
      const auto [entry, is_new] = others.try_emplace(landmark);
      if (is_new) {
        entry->second = scene.descriptors[random.below(scene.descriptors.size())];
        std::reverse(entry->second.begin(), entry->second.end());
      }
      observations->features.descriptors[k] = entry->second;
    }
    scene.frames[i].observations = std::move(observations);
  }
  return scene;
}

TEST_CASE("A place seen again is found, whatever the map says of where it is") {
  const TwoParts parts(circle_twice());
  for (std::size_t i = 1; i < kLaps; i += 3) {
    const std::size_t newer = kLaps + i;
    for (const std::size_t older : {i, i - 1}) {
      const LoopVerification verified = parts.verify(newer, older);
      REQUIRE(verified.loop);
      CHECK(verified.reason == LoopRejection::kNone);
      CHECK(verified.found_share > 0.5);
      const LoopMeasurement& loop = *verified.loop;
      CHECK(!loop.with_scale);
      CHECK(loop.keyframe_from_match.scale() == 1);
      const Rigid3d off =
          inverse(parts.true_motion(newer, older)) * without_scale(loop.keyframe_from_match);
      CHECK(off.translation().norm() < 0.01);
      CHECK(so3_log(off.rotation()).norm() < 0.003);
    }
  }
}

TEST_CASE("What a loop says is one, is, and each landmark occurs once") {
  const TwoParts parts(circle_twice());
  const LoopVerification verified = parts.verify(kLaps + 5, 4);
  REQUIRE(verified.loop);
  std::set<LandmarkId> named;
  int wrong = 0;
  for (const LandmarkMerge& merge : verified.loop->same) {
    wrong += parts.scene_landmark(merge.keep) != parts.scene_landmark(merge.drop) ? 1 : 0;
    CHECK(named.insert(merge.keep).second);
    CHECK(named.insert(merge.drop).second);
    CHECK(merge.keep < merge.drop);  // the older side's stays
  }
  CHECK(verified.loop->same.size() > 100);
  CHECK(wrong <= 0.02 * static_cast<double>(verified.loop->same.size()));
  const auto& truth = parts.scene.frames[kLaps + 5].landmark;
  for (const LandmarkObservation& added : verified.loop->new_observations) {
    CHECK(named.insert(added.landmark).second);
    CHECK(added.observation.keyframe == verified.loop->keyframe);
    wrong += truth[added.observation.keypoint] != parts.scene_landmark(added.landmark) ? 1 : 0;
  }
  CHECK(wrong <= 0.03 * static_cast<double>(named.size()));
}

TEST_CASE("A fisheye alone has a scale of its own, which the loop measures") {
  SyntheticScene both = circle_twice(true);
  std::vector<SyntheticFrame> frames;  // first the pair's lap, then the fisheye's
  for (std::size_t time = 0; time < 2 * kLaps; ++time) {
    frames.push_back(both.frames[2 * time + (time < kLaps ? 0 : 1)]);
  }
  both.frames = std::move(frames);
  const TwoParts parts(std::move(both), 1.2);
  int found = 0;
  for (std::size_t i = 2; i < kLaps; i += 4) {
    const LoopVerification verified = parts.verify(kLaps + i, i);
    if (!verified.loop) continue;
    ++found;
    CHECK(verified.loop->with_scale);
    CHECK(verified.loop->keyframe_from_match.scale() == Approx(1.2).epsilon(0.01));
    const Rigid3d off = inverse(parts.true_motion(kLaps + i, i)) *
                        without_scale(verified.loop->keyframe_from_match);
    CHECK(off.translation().norm() < 0.03);
    CHECK(so3_log(off.rotation()).norm() < 0.01);
  }
  CHECK(found >= 4);
}

TEST_CASE("A stereo pair and a fisheye find one another, at the scale that the pairs know") {
  // Both fly both laps. Frame 2 t is the pair's, the next one the fisheye's, whose strongest
  // neighbours are other fisheyes.
  const SyntheticScene scene = circle_twice(true);
  FillOptions fill;
  fill.split = 2 * kLaps;
  fill.split_drift = drift(1);
  const FilledMap filled = fill_map(scene, fill);
  KeyframeDatabase places(scene_vocabulary(scene));
  places.follow(filled.map.view());
  for (std::size_t time = 0; time < kLaps; time += 8) {
    for (const std::size_t newer_is_fisheye : {0, 1}) {
      const std::size_t older = 2 * time + (1 - newer_is_fisheye);
      const std::size_t newer = 2 * (kLaps + time) + newer_is_fisheye;
      const LoopVerification verified = LoopVerifier({}).verify(
          filled.map.view(), filled.keyframes[newer], filled.keyframes[older], places);
      REQUIRE(verified.loop);
      CHECK(!verified.loop->with_scale);
      CHECK(verified.loop->keyframe_from_match.scale() == 1);
      const Rigid3d off = inverse(scene.frames[newer].cam_from_world *
                                  inverse(scene.frames[older].cam_from_world)) *
                          without_scale(verified.loop->keyframe_from_match);
      CHECK(off.translation().norm() < 0.003);
      CHECK(so3_log(off.rotation()).norm() < 0.001);
    }
  }
}

TEST_CASE("Other places are none") {
  const TwoParts parts(circle_twice());
  for (std::size_t i = 0; i < kLaps; i += 5) {
    const LoopVerification verified = parts.verify(kLaps + i, (i + kLaps / 2) % kLaps);
    CHECK(!verified.loop);
    CHECK(verified.reason != LoopRejection::kNone);
  }
}

TEST_CASE("The same texture in another shape is another place") {
  // What the second lap sees bears the descriptors of landmarks that lie elsewhere.
  const SyntheticScene scene = circle_twice();
  SyntheticScene shuffled = scene;
  const std::size_t count = scene.descriptors.size();
  for (std::size_t i = kLaps; i < shuffled.frames.size(); ++i) {
    auto observations = std::make_shared<FrameObservations>(*shuffled.frames[i].observations);
    // The descriptors of one keyframe, handed on by 7 keypoints: all are known, in other places.
    auto& descriptors = observations->features.descriptors;
    std::rotate(descriptors.begin(), descriptors.begin() + 7, descriptors.end());
    shuffled.frames[i].observations = std::move(observations);
  }
  REQUIRE(count > 0);
  const TwoParts parts(std::move(shuffled));
  for (std::size_t i = 1; i < kLaps; i += 3) {
    const LoopVerification verified = parts.verify(kLaps + i, i);
    CHECK(verified.matches > 20);
    CHECK(verified.reason == LoopRejection::kNoGeometry);
  }
}

TEST_CASE("A patch that repeats, in its texture and its shape, is no loop") {
  const SyntheticScene scene = circle_twice();
  for (const double share : {0.05, 0.09}) {
    // A share of all landmarks, everywhere: the same points, exactly, in other surroundings.
    const auto alike = [&](int landmark) { return landmark % 100 < 100 * share; };
    const TwoParts parts(with_other_surroundings(scene, alike));
    for (std::size_t i = 1; i < kLaps; i += 4) {
      const LoopVerification verified = parts.verify(kLaps + i, i);
      INFO(share << ' ' << i << ' ' << verified.matches << ' ' << verified.final_matches << ' '
                 << verified.found_share);
      CHECK(!verified.loop);
    }
  }
  LoopVerifierOptions lenient;
  lenient.min_found_share = 0;
  lenient.min_matches = lenient.min_final_matches = 10;
  lenient.pose.min_inliers = 8;
  lenient.min_confirmations = 5;
  const TwoParts parts(
      with_other_surroundings(scene, [](int landmark) { return landmark % 100 < 9; }));
  int fooled = 0;
  for (std::size_t i = 1; i < kLaps; i += 4) {
    fooled += parts.verify(kLaps + i, i, lenient).loop ? 1 : 0;
  }
  CHECK(fooled > 0);  // it is these bounds that refuse them
}

TEST_CASE("A compact patch that repeats exactly is no loop") {
  SyntheticSceneOptions options;
  options.times = 2 * kLaps;
  options.step = 2 * std::numbers::pi * 3 / kLaps;
  options.landmarks = 12000;
  options.noise = 0.1;
  options.clutter = 50;
  const SyntheticScene scene = make_synthetic_scene(options);
  constexpr std::size_t kAt = 5;
  const auto verified_with = [&](double radius) {  // [m] of the patch amid the view
    const auto in_patch = [&](int landmark) {
      const Eigen::Vector3d point = scene.frames[kAt].cam_from_world *
                                    scene.points_in_world[static_cast<std::size_t>(landmark)];
      return point.head<2>().norm() < radius;
    };
    return TwoParts(with_other_surroundings(scene, in_patch)).verify(kLaps + kAt, kAt);
  };
  CHECK(verified_with(0.3).reason == LoopRejection::kFewAfterSearch);  // 29
  const LoopVerification patch = verified_with(0.6);                   // 132
  CHECK(patch.inliers > 100);  // it does agree with one motion
  CHECK(patch.reason == LoopRejection::kUnlike);
}

TEST_CASE("A place that no neighbour sees is not confirmed") {
  const TwoParts parts(circle_twice());
  LoopVerifierOptions options;
  options.min_confirmations = 5000;
  const LoopVerification verified = parts.verify(kLaps + 5, 5, options);
  CHECK(!verified.loop);
  CHECK(verified.reason == LoopRejection::kUnconfirmed);
  CHECK(verified.confirmations > 15);
}

TEST_CASE("Keyframes that have gone are no loops, and the same input gives the same bits") {
  TwoParts parts(circle_twice());
  const LoopVerification once = parts.verify(kLaps + 5, 5);
  const LoopVerification again = parts.verify(kLaps + 5, 5);
  REQUIRE(once.loop);
  CHECK(once.loop->keyframe_from_match.params == again.loop->keyframe_from_match.params);
  MapEdit edit;
  edit.erased_keyframes = {parts.filled.keyframes[5]};
  parts.filled.map.apply(edit);
  CHECK(!parts.verify(kLaps + 5, 5).loop);
  parts.places->follow(parts.map());
  CHECK(!parts.verify(kLaps + 5, 5).loop);
}

}  // namespace
}  // namespace hybrid_slam
