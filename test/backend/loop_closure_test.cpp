#include "backend/problem/loop_closure.h"

#include <algorithm>

#include "backend/problem/loop_correction.h"
#include "cameras/geometry/se3.h"
#include "test/backend/drifted_circle.h"
#include "test/support/random.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

LoopClosureOptions free_ends() {
  LoopClosureOptions options;
  options.graph = chain_options();
  return options;
}

Rigid3d random_motion(Random& random) {
  Vector6d tangent;
  tangent << random.gaussian3(1.5), random.gaussian3(0.8);
  return se3_exp(tangent);
}

TEST_CASE("loop closure: a loop that explains the drift is taken") {
  FilledMap filled = circle_map();
  const MapTruth truth = truth_of(filled.map.view());
  let_drift(filled.map, truth, small_drift(), 1);
  const double before = worst_position_error(filled.map.view(), truth);
  REQUIRE(before > 0.2);
  const LoopClosure closure =
      close_loop(filled.map.view(), {measured(truth, 0, 23)}, {}, free_ends());
  REQUIRE(closure.taken == std::vector<std::size_t>{0});
  CHECK(closure.correction.cam_from_world.size() == 23);
  const std::vector<LandmarkId> ids = filled.map.view().landmark_ids();
  const auto carried = std::count_if(ids.begin(), ids.end(), [&](LandmarkId id) {
    return filled.map.view().at(id).reference != filled.map.view().origin();
  });
  CHECK(static_cast<long>(closure.correction.point_in_world.size()) == carried);
  filled.map.move(closure.correction.cam_from_world, closure.correction.point_in_world);
  CHECK(worst_position_error(filled.map.view(), truth) < 0.35 * before);
}

TEST_CASE("loop closure: false loops are refused, whatever they claim") {
  FilledMap filled = circle_map(48);
  const MapTruth truth = truth_of(filled.map.view());
  let_drift(filled.map, truth, 0.2 * small_drift(), 1);
  Random random(5);
  const std::vector<LoopEnds> closed{{KeyframeId(0), KeyframeId(47)}};
  int taken = 0;
  for (int i = 0; i < 60; ++i) {
    const auto a = static_cast<std::uint32_t>(random.below(24));
    const auto b = static_cast<std::uint32_t>(a + 10 + random.below(13));
    PoseConstraint wrong = measured(truth, a, b);
    wrong.a_from_b = Sim3d(random_motion(random));
    const LoopClosure closure = close_loop(filled.map.view(), {wrong}, closed, free_ends());
    taken += closure.taken.empty() ? 0 : 1;
    CHECK(closure.correction.cam_from_world.empty() == closure.taken.empty());
  }
  CHECK(taken == 0);
}

TEST_CASE("loop closure: false ones that were refused do not keep a true one out") {
  FilledMap filled = circle_map();
  const MapTruth truth = truth_of(filled.map.view());
  let_drift(filled.map, truth, small_drift(), 1);
  Random random(9);
  std::vector<PoseConstraint> loops;
  for (int i = 0; i < 5; ++i) {
    loops.push_back(measured(truth, 2, 20));
    loops.back().a_from_b = Sim3d(random_motion(random));
  }
  loops.push_back(measured(truth, 0, 23));
  const LoopClosure closure = close_loop(filled.map.view(), loops, {}, free_ends());
  CHECK(closure.taken == std::vector<std::size_t>{5});
}

TEST_CASE("loop closure: two that agree are believed where one is not") {
  FilledMap filled = circle_map();
  const MapTruth truth = truth_of(filled.map.view());
  let_drift(filled.map, truth, small_drift(), 1);
  const double before = worst_position_error(filled.map.view(), truth);
  LoopClosureOptions options = free_ends();
  const double alone = close_loop(filled.map.view(), {measured(truth, 0, 23)}, {}, options).chi2;
  // So stiff a map that the loop lies just beyond what is believed.
  const double stiffer = std::sqrt(22 / alone);
  options.graph.translation_share /= stiffer;
  options.graph.min_translation_sigma /= stiffer;
  options.graph.rotation_sigma /= stiffer;
  Random random(3);
  PoseConstraint wrong = measured(truth, 3, 19);
  wrong.a_from_b = Sim3d(random_motion(random));
  std::vector<PoseConstraint> loops{wrong, measured(truth, 0, 23)};
  CHECK(close_loop(filled.map.view(), loops, {}, options).taken.empty());
  loops.push_back(measured(truth, 1, 22));
  const LoopClosure closure = close_loop(filled.map.view(), loops, {}, options);
  CHECK(closure.taken == std::vector<std::size_t>{1, 2});
  filled.map.move(closure.correction.cam_from_world, closure.correction.point_in_world);
  CHECK(worst_position_error(filled.map.view(), truth) < 0.35 * before);
}

TEST_CASE("loop closure: earlier loops stay closed") {
  FilledMap filled = circle_map();
  const MapTruth truth = truth_of(filled.map.view());
  const auto off = [&](std::uint32_t a, std::uint32_t b) {
    const MapSnapshot& map = filled.map.view();
    const Rigid3d motion =
        map.at(KeyframeId(a)).cam_from_world * inverse(map.at(KeyframeId(b)).cam_from_world);
    return (measured(truth, a, b).a_from_b.params - Sim3d(motion).params).norm();
  };
  // The ends fit, the middle does not.
  PoseConstraint shifted = measured(truth, 4, 14);
  shifted.a_from_b =
      Sim3d(se3_exp((Vector6d() << 0.2, 0, 0, 0, 0, 0).finished())) * shifted.a_from_b;
  const auto close_with = [&](const std::vector<LoopEnds>& closed) {
    FilledMap fresh = circle_map();
    filled = std::move(fresh);
    const LoopClosure closure = close_loop(filled.map.view(), {shifted}, closed, free_ends());
    REQUIRE(closure.taken.size() == 1);
    filled.map.move(closure.correction.cam_from_world, closure.correction.point_in_world);
    return off(0, 23);
  };
  const double torn = close_with({});
  const double held = close_with({{KeyframeId(0), KeyframeId(23)}});
  CHECK(torn > 0.02);
  CHECK(held < 0.5 * torn);
}

TEST_CASE("loop closure: a keyframe that has gone closes nothing") {
  FilledMap filled = circle_map();
  const MapTruth truth = truth_of(filled.map.view());
  MapEdit edit;
  edit.erased_keyframes = {KeyframeId(20)};
  filled.map.apply(edit);
  CHECK(close_loop(filled.map.view(), {measured(truth, 0, 20)}, {}, free_ends()).taken.empty());
  const LoopClosure closure = close_loop(
      filled.map.view(), {measured(truth, 0, 20), measured(truth, 0, 23)}, {}, free_ends());
  CHECK(closure.taken == std::vector<std::size_t>{1});
}

TEST_CASE("A correction carries what was born since along") {
  FilledMap filled = circle_map();
  Map& map = filled.map;
  const MapTruth truth = truth_of(map.view());
  // As solved when keyframe 16 was the newest, of keyframes 1 to 16 and some landmarks.
  const Rigid3d moved_world = se3_exp(Vector6d::Constant(0.1));  // new from old
  BundleResult result;
  for (std::uint32_t i = 1; i <= 16; ++i) {
    result.cam_from_world.emplace_back(
        KeyframeId(i), map.view().at(KeyframeId(i)).cam_from_world * inverse(moved_world));
  }
  const std::vector<LandmarkId> ids = map.view().landmark_ids();
  for (const LandmarkId id : ids) {
    const Landmark& landmark = map.view().at(id);
    if (landmark.reference.value < 10) {
      result.point_in_world.emplace_back(id, moved_world * landmark.point_in_world);
    }
  }
  // A keyframe known to it goes meanwhile: its children hang elsewhere.
  MapEdit edit;
  edit.erased_keyframes = {KeyframeId(15)};
  map.apply(edit);
  carry_the_rest(map.view(), result);
  map.move(result.cam_from_world, result.point_in_world);
  for (const KeyframeId id : map.view().keyframe_ids()) {
    if (id == map.view().origin()) continue;
    const Rigid3d wanted = truth.cam_from_world[id.value] * inverse(moved_world);
    CHECK((map.view().at(id).cam_from_world.params - wanted.params).norm() < 1e-9);
  }
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const Landmark* landmark = map.view().find(ids[i]);
    if (landmark == nullptr || landmark->reference == map.view().origin()) continue;
    CHECK((landmark->point_in_world - moved_world * truth.points[i]).norm() < 1e-9);
  }
}

}  // namespace
}  // namespace hybrid_slam
