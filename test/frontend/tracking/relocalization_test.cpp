#include "frontend/tracking/relocalization.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>

#include "test/support/frame_view.h"

namespace hybrid_slam {
namespace {

SyntheticSceneOptions orbit(std::uint64_t seed = 1) {
  SyntheticSceneOptions options;
  options.times = 30;
  options.landmarks = 3000;
  options.clutter = 100;
  options.outlier_rate = 0.1;
  options.seed = seed;
  return options;
}

FilledMap map_of(const SyntheticScene& scene) {
  FillOptions fill;
  fill.stride = 2;
  return fill_map(scene, fill);
}

std::vector<KeyframeId> newest(const FilledMap& filled, int count = 50) {
  return newest_keyframes(filled.map.view(), count);
}

std::optional<RelocalizedFrame> find_in(const std::vector<KeyframeId>& keyframes,
                                        const FilledMap& filled, const FrameView& frame) {
  const MapSnapshot& map = filled.map.view();
  const FeatureView view = frame.view();
  const auto match = [&](KeyframeId id) {
    return match_keyframe(map, id, view.features, 0.75, 0.7);
  };
  return relocalize(map, view, keyframes, match, {}, {}, {});
}

double center_distance(const Rigid3d& a, const Rigid3d& b) {
  return (origin_in_a(a) - origin_in_a(b)).norm();
}

// Share of the landmarks found that are those the keypoints truly show.
double right_share(const FilledMap& filled, const FrameView& frame, const RelocalizedFrame& found) {
  int right = 0;
  int all = 0;
  for (std::size_t i = 0; i < found.landmarks.size(); ++i) {
    if (!found.landmarks[i].valid()) continue;
    ++all;
    right += frame.truth(filled, i) == found.landmarks[i] ? 1 : 0;
  }
  CHECK(all == found.inliers);
  return all == 0 ? 0 : static_cast<double>(right) / all;
}

TEST_CASE("A frame from anywhere in the map is found in it") {
  const SyntheticScene scene = make_synthetic_scene(orbit());
  const FilledMap filled = map_of(scene);
  for (const std::size_t index : {std::size_t{1}, std::size_t{11}, std::size_t{23}}) {
    const FrameView frame(scene, index);
    const auto found = find_in(newest(filled), filled, frame);
    REQUIRE(found);
    CHECK(found->inliers >= 50);
    CHECK(center_distance(found->cam_from_world, frame.true_pose()) < 0.02);
    CHECK(right_share(filled, frame, *found) > 0.98);
    const Keyframe* keyframe = filled.map.view().find(found->keyframe);
    REQUIRE(keyframe != nullptr);
    const auto& seen = keyframe->landmarks;
    const auto shared =
        std::count_if(found->landmarks.begin(), found->landmarks.end(), [&](LandmarkId id) {
          return id.valid() && std::find(seen.begin(), seen.end(), id) != seen.end();
        });
    CHECK(shared >= PnpRansacOptions().min_inliers);
  }
}

TEST_CASE("A fisheye is found in a map of stereo keyframes") {
  SyntheticSceneOptions options = orbit();
  options.fisheye = true;
  const SyntheticScene scene = make_synthetic_scene(options);
  const FilledMap filled = map_of(scene);  // every second frame: the stereo ones
  const FrameView frame(scene, 25);
  REQUIRE(baseline(frame.camera()) == 0);
  const auto found = find_in(newest(filled), filled, frame);
  REQUIRE(found);
  CHECK(center_distance(found->cam_from_world, frame.true_pose()) < 0.03);
  CHECK(right_share(filled, frame, *found) > 0.98);
}

TEST_CASE("A frame of another place is not found") {
  const SyntheticScene scene = make_synthetic_scene(orbit());
  const SyntheticScene elsewhere = make_synthetic_scene(orbit(2));
  const FilledMap filled = map_of(scene);
  CHECK(!find_in(newest(filled), filled, FrameView(elsewhere, 5)));
}

TEST_CASE("Only so many keyframes are tried, newest first") {
  const SyntheticScene scene = make_synthetic_scene(orbit());
  const FilledMap filled = map_of(scene);
  const FrameView far_from_newest(scene, 13);  // across the circle
  CHECK(!find_in(newest(filled, 1), filled, far_from_newest));
  const auto found = find_in(newest(filled, 1), filled, FrameView(scene, 29));
  REQUIRE(found);
  CHECK(found->keyframe == filled.keyframes.back());
}

TEST_CASE("Descriptors of another kind match nothing") {
  const SyntheticScene scene = make_synthetic_scene(orbit());
  const FilledMap filled = map_of(scene);
  FrameView frame(scene, 11);
  frame.features().kind = DescriptorKind::kRootSiftOpenCv;
  for (const LandmarkId id :
       match_keyframe(filled.map.view(), filled.keyframes[5], frame.features(), 0.75, 0.7)) {
    CHECK(!id.valid());
  }
  CHECK(!find_in(newest(filled), filled, frame));
}

TEST_CASE("RelocalizationOptions out of range are refused") {
  CHECK(RelocalizationOptions().validate().empty());
  const auto refused = [](auto set) {
    for (const double value : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
      RelocalizationOptions options;
      set(options, value);
      CHECK(!options.validate().empty());
    }
  };
  refused([](auto& options, double value) { options.ratio = value; });
  refused([](auto& options, double value) { options.max_descriptor_distance = value; });
  refused([](auto& options, double value) { options.wide_radius = value; });
  refused([](auto& options, double value) { options.ransac.confidence = value; });
}

}  // namespace
}  // namespace hybrid_slam
