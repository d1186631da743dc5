#include <catch2/catch.hpp>

#include "test/support/random_edits.h"

namespace hybrid_slam {
namespace {

TEST_CASE("5000 random edits leave a consistent map, and old snapshots as they were") {
  SyntheticSceneOptions options;
  options.times = 12;
  options.landmarks = 600;
  options.fisheye = true;
  FilledMap filled = fill_map(make_synthetic_scene(options), {});
  RandomEdits edits(filled, 3);
  const auto first = filled.map.snapshot();
  const std::size_t landmarks = first->landmark_count();
  std::shared_ptr<const MapSnapshot> latest;
  for (int i = 0; i < 5000; ++i) {
    edits.step();
    if (i % 7 == 0) latest = filled.map.snapshot();
    if (i % 250 == 0) REQUIRE(filled.map.check_consistency() == std::vector<std::string>{});
  }
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
  CHECK(filled.map.view().keyframe_count() > 3);
  CHECK(filled.map.view().keyframe_count() != filled.keyframes.size());
  CHECK(filled.map.view().landmark_count() > 20);
  CHECK(first->landmark_count() == landmarks);
  CHECK(first->keyframe_count() == 24);
  // Every keyframe there ever was still has a pose.
  for (const KeyframeId id : filled.keyframes) {
    CHECK(filled.map.view().cam_from_world(id).params.allFinite());
  }
}

}  // namespace
}  // namespace hybrid_slam
