#include "frontend/mapping/culling.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <limits>

#include "test/support/filled_map.h"

namespace hybrid_slam {
namespace {

// Keyframes of a stereo pair whose keypoint i, if it has a landmark, shows landmark i.
class ProbationMap {
 public:
  static constexpr std::uint32_t kPoints = 10;

  ProbationMap() { map.add_camera(synthetic_stereo_camera(0.1)); }

  // `seen`: landmarks it tracks; `born`: the keypoints that make new ones. `stereo`: whether it has
  // right matches.
  KeyframeId add(const std::vector<std::uint32_t>& seen, const std::vector<std::uint32_t>& born,
                 bool stereo = true) {
    auto observations = std::make_shared<FrameObservations>();
    observations->camera = CameraId(0);
    observations->frame_index = frames_;
    observations->features.kind = DescriptorKind::kSynthetic;
    observations->features.keypoints.assign(kPoints, {100, 100, 2, 0, 5, 1});
    observations->features.descriptors.resize(kPoints);
    observations->u_right.assign(kPoints, stereo ? 90.F : kNoRightMatch);
    NewKeyframe made;
    made.observations = observations;
    made.cam_from_world =
        Rigid3d(Eigen::Quaterniond::Identity(), {-0.1 * static_cast<double>(frames_++), 0, 0});
    made.landmarks.resize(kPoints);
    for (const std::uint32_t i : seen) made.landmarks[i] = LandmarkId(i);
    for (const std::uint32_t i : born) made.new_points.push_back({i, {0.1 * i, 0, 3}});
    made.reference = map.view().origin();
    return map.add_keyframe(made);
  }

  Map map;

 private:
  std::int64_t frames_ = 0;
};

std::vector<std::uint32_t> all_points() { return {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}; }

std::vector<std::uint32_t> values(const std::vector<LandmarkId>& ids) {
  std::vector<std::uint32_t> result;
  for (const LandmarkId id : ids) result.push_back(id.value);
  std::sort(result.begin(), result.end());
  return result;
}

TEST_CASE("Keyframes go out of use when the newest ones share few landmarks with them") {
  SyntheticSceneOptions scene;
  scene.trajectory = SceneTrajectory::kCorridor;
  scene.times = 80;
  scene.step = 3;
  const FilledMap filled = fill_map(make_synthetic_scene(scene), {});
  const MapSnapshot& map = filled.map.view();
  const auto shared = [&](KeyframeId a, KeyframeId b) {
    int count = 0;
    for (const LandmarkId id : map.at(a).landmarks) {
      const auto& others = map.at(b).landmarks;
      count += id.valid() && std::count(others.begin(), others.end(), id) > 0 ? 1 : 0;
    }
    return count;
  };
  const std::vector<KeyframeId>& ids = filled.keyframes;
  for (const std::size_t full : {std::size_t{1}, std::size_t{5}}) {
    std::vector<KeyframeId> expected;
    for (std::size_t i = 0; i < ids.size(); ++i) {
      bool used = i + full >= ids.size();
      for (std::size_t j = ids.size() - full; j < ids.size(); ++j) {
        used = used || shared(ids[i], ids[j]) >= 15;
      }
      if (!used) expected.push_back(ids[i]);
    }
    CHECK(expected.size() > ids.size() / 2);
    CHECK(expected.size() < ids.size() - full);
    CullingOptions options;
    options.full_keyframes = static_cast<int>(full);
    KeyframeUse use(options, map);
    CHECK(use.gone_out(map) == expected);
    CHECK(use.gone_out(map).empty());  // nothing more has gone
  }
  CullingOptions options;
  options.full_keyframes = 0;
  CHECK(KeyframeUse(options, map).gone_out(map).empty());
}

TEST_CASE("A landmark must be seen again within two keyframes") {
  ProbationMap made;
  LandmarkProbation probation{CullingOptions()};
  CHECK(probation.cull(made.map.view(), made.add({}, all_points())).empty());
  // A single further view makes 3 with the stereo one, which counts twice.
  CHECK(probation.cull(made.map.view(), made.add({0, 1, 2}, {}, false)).empty());
  const MapEdit edit = probation.cull(made.map.view(), made.add({3, 4}, {}, false));
  CHECK(values(edit.erased_landmarks) == std::vector<std::uint32_t>{5, 6, 7, 8, 9});
  made.map.apply(edit);
  CHECK(made.map.check_consistency().empty());
  CHECK(made.map.view().landmark_count() == 5);
}

TEST_CASE("A landmark that is visible but rarely found goes while it is young") {
  ProbationMap made;
  LandmarkProbation probation{CullingOptions()};
  probation.cull(made.map.view(), made.add({}, all_points()));
  MapEdit counts;
  for (int frame = 0; frame < 11; ++frame) {
    counts.counted.push_back({LandmarkId(0), 1, 0});
    counts.counted.push_back({LandmarkId(1), 1, frame < 3 ? 1 : 0});
  }
  made.map.apply(counts);  // landmark 0: 1 of 12 found; landmark 1: 4 of 12
  const auto edit = probation.cull(made.map.view(), made.add(all_points(), {}));
  CHECK(values(edit.erased_landmarks) == std::vector<std::uint32_t>{0});
}

TEST_CASE("Probation ends: an old landmark is not judged any more") {
  ProbationMap made;
  LandmarkProbation probation{CullingOptions()};
  probation.cull(made.map.view(), made.add({}, all_points()));
  for (int i = 0; i < 4; ++i) {
    CHECK(probation.cull(made.map.view(), made.add(all_points(), {})).empty());
  }
  MapEdit counts;
  counts.counted = {{LandmarkId(0), 100, 0}};
  made.map.apply(counts);
  CHECK(probation.cull(made.map.view(), made.add(all_points(), {})).empty());
}

TEST_CASE("Landmarks that mapping makes after the call are watched, too") {
  ProbationMap made;
  LandmarkProbation probation{CullingOptions()};
  const KeyframeId first = made.add({}, {0, 1, 2});
  probation.cull(made.map.view(), first);
  MapEdit births;
  births.new_landmarks.push_back({{0.5, 0, 3}, {{first, 5}}});  // landmark 3
  made.map.apply(births);
  CHECK(probation.cull(made.map.view(), made.add({0, 1, 2}, {})).empty());
  const auto edit = probation.cull(made.map.view(), made.add({0, 1, 2}, {}));
  CHECK(values(edit.erased_landmarks) == std::vector<std::uint32_t>{3});
}

TEST_CASE("At the end the youngest landmarks are judged by the frames since they were made") {
  ProbationMap made;
  LandmarkProbation probation{CullingOptions()};
  const KeyframeId first = made.add({}, {0, 1, 2, 3});
  probation.cull(made.map.view(), first);
  MapEdit edit;
  edit.new_landmarks.push_back({{0.5, 0, 3}, {{first, 5}}});  // landmark 4, by mapping
  // Landmark 3 is not in view any more.
  edit.counted = {{LandmarkId(0), 1, 0}, {LandmarkId(1), 4, 1}, {LandmarkId(2), 5, 1}};
  made.map.apply(edit);
  MapEdit counts;
  counts.counted = {{LandmarkId(4), 1, 0}};
  made.map.apply(counts);
  const MapEdit end = probation.conclude(made.map.view());
  CHECK(values(end.erased_landmarks) == std::vector<std::uint32_t>{0, 2, 4});
  made.map.apply(end);
  CHECK(made.map.check_consistency().empty());
  CHECK(probation.conclude(made.map.view()).empty());
}

TEST_CASE("At the end landmarks that were judged before are not judged again") {
  ProbationMap made;
  LandmarkProbation probation{CullingOptions()};
  probation.cull(made.map.view(), made.add({}, all_points()));
  for (int i = 0; i < 3; ++i) probation.cull(made.map.view(), made.add(all_points(), {}));
  MapEdit counts;
  counts.counted = {{LandmarkId(0), 100, 0}};
  made.map.apply(counts);
  CHECK(probation.conclude(made.map.view()).empty());
}

// Eight views of the same ground from nearly the same place.
FilledMap hover_map() {
  SyntheticSceneOptions options;
  options.trajectory = SceneTrajectory::kHover;
  options.times = 8;
  options.landmarks = 800;
  return fill_map(make_synthetic_scene(options), {});
}

TEST_CASE("Redundant keyframes go; the origin, the kept and the newest stay") {
  FilledMap filled = hover_map();
  filled.map.set_keep(filled.keyframes[3]);
  const KeyframeId newest = filled.keyframes.back();
  const MapEdit edit = cull_keyframes(filled.map.view(), newest, {});
  CHECK(edit.erased_keyframes.size() >= 2);
  for (const KeyframeId id : edit.erased_keyframes) {
    CHECK(id != filled.map.view().origin());
    CHECK(id != filled.keyframes[3]);
    CHECK(id != newest);
  }
  filled.map.apply(edit);
  CHECK(filled.map.check_consistency().empty());
  // What goes is seen by three others, and these three can always stay.
  CHECK(filled.map.view().keyframe_count() >= 3);
  CHECK(cull_keyframes(filled.map.view(), newest, {}).erased_keyframes.empty());
}

TEST_CASE("Where each keyframe sees its own ground none is redundant") {
  SyntheticSceneOptions options;
  options.times = 8;  // an eighth of the circle apart
  const FilledMap filled = fill_map(make_synthetic_scene(options), {});
  for (const KeyframeId id : filled.keyframes) {
    CHECK(cull_keyframes(filled.map.view(), id, {}).erased_keyframes.empty());
  }
}

TEST_CASE("Only close landmarks count for a stereo keyframe") {
  const FilledMap filled = hover_map();
  CullingOptions options;
  options.close_baselines = 10;  // 1.2 m: all are farther, so nothing can be said of any keyframe
  CHECK(
      cull_keyframes(filled.map.view(), filled.keyframes.back(), options).erased_keyframes.empty());
}

TEST_CASE("CullingOptions out of range are refused") {
  CHECK(CullingOptions().validate().empty());
  const auto refused = [](auto set) {
    for (const double value : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
      CullingOptions options;
      set(options, value);
      CHECK(!options.validate().empty());
    }
  };
  refused([](auto& options, double value) { options.min_found_ratio = value; });
  refused([](auto& options, double value) { options.redundancy.share = value; });
  refused([](auto& options, double value) { options.close_baselines = value; });
}

TEST_CASE("A view is redundant when more than the share of what is in it is well seen") {
  ProbationMap made;
  made.add({}, all_points());
  made.add({0, 1, 2, 3, 4, 5, 6}, {});
  made.add({0, 1, 2, 3, 4, 5, 6}, {});
  const MapSnapshot& map = made.map.view();
  std::vector<LandmarkInView> in_view;
  for (const LandmarkId id : map.landmark_ids()) {
    in_view.push_back({&map.at(id), 1});  // all keyframes see it at a finer scale
  }
  for (int others = 0; others < 4; ++others) {
    for (const double share : {0.1, 0.5, 0.52, 0.6, 0.69, 0.7, 0.71, 1.0}) {
      CAPTURE(others, share);
      const bool expected = 7 > share * (10 + others);  // seven have three observers
      CHECK(is_redundant(map, in_view, others, {share, 3}) == expected);
      std::vector<LandmarkInView> reversed(in_view.rbegin(), in_view.rend());
      CHECK(is_redundant(map, reversed, others, {share, 3}) == expected);
    }
  }
  CHECK_FALSE(is_redundant(map, {}, 0, {0.9, 3}));
}

}  // namespace
}  // namespace hybrid_slam
