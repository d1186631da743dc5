#include "backend/problem/loop_graph.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "backend/problem/solve_bundle.h"
#include "cameras/geometry/se3.h"
#include "test/backend/drifted_circle.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

void correct(FilledMap& filled, const std::vector<PoseConstraint>& loops,
             const LoopGraphOptions& options) {
  const ProblemConfig config = make_loop_graph(filled.map.view(), loops, options);
  const BundleResult result = solve_bundle(filled.map.view(), config);
  CHECK(result.summary.end == SolveEnd::kConverged);
  filled.map.move(result.cam_from_world, result.point_in_world);
}

TEST_CASE("loop graph: the tree, strong covisibility once each, and the loops") {
  const FilledMap filled = circle_map();
  const MapSnapshot& map = filled.map.view();
  LoopGraphOptions options;
  options.min_shared_landmarks = 60;
  PoseConstraint loop = measured(truth_of(map), 0, 20);
  const ProblemConfig config = make_loop_graph(map, {loop}, options);
  CHECK(config.fixed_poses == std::vector<KeyframeId>{map.origin()});
  CHECK(config.variable_poses.size() == map.keyframe_count() - 1);
  CHECK(config.variable_landmarks.empty());

  std::set<std::pair<KeyframeId, KeyframeId>> wanted;
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    if (keyframe.parent.valid()) wanted.insert(std::minmax(keyframe.parent, id));
    for (const Covisible& edge : keyframe.covisible) {
      if (edge.shared_landmarks >= 60) wanted.insert(std::minmax(edge.id, id));
    }
  }
  CHECK(wanted.size() > map.keyframe_count());  // more than the tree
  std::set<std::pair<KeyframeId, KeyframeId>> found;
  for (const PoseConstraint& edge : config.constraints) {
    if (edge.loop) continue;
    CHECK(found.insert(std::minmax(edge.a, edge.b)).second);
    const Rigid3d a_from_b = map.at(edge.a).cam_from_world * inverse(map.at(edge.b).cam_from_world);
    CHECK((edge.a_from_b.params - Sim3d(a_from_b).params).norm() < 1e-12);
    const double sigma = std::max(0.005, 0.05 * a_from_b.translation().norm());
    CHECK(edge.information(0, 0) == Approx(1 / (sigma * sigma)));
    CHECK(edge.information(6, 6) == Approx(1e8));  // two stereo pairs
    CHECK(edge.information(4, 4) == Approx(1 / (0.01 * 0.01)));
  }
  CHECK(found == wanted);
  const PoseConstraint& last = config.constraints.back();
  CHECK(last.loop);
  CHECK(last.information(3, 3) == Approx(1 / (0.01 * 0.01)));  // the default weights
  CHECK(make_loop_graph(Map().view(), {loop}, options).constraints.empty());
}

TEST_CASE("loop graph: a loop spreads the drift over the way, landmarks follow") {
  FilledMap filled = circle_map();
  const MapTruth truth = truth_of(filled.map.view());
  let_drift(filled.map, truth, small_drift(), 1);
  const double before = worst_position_error(filled.map.view(), truth);
  REQUIRE(before > 0.2);
  const auto in_reference = [](const MapSnapshot& map, LandmarkId id) -> Eigen::Vector3d {
    const Landmark& landmark = map.at(id);
    return map.at(landmark.reference).cam_from_world * landmark.point_in_world;
  };
  const auto old = filled.map.snapshot();
  PoseConstraint loop = measured(truth, 0, 23);
  loop.information = 1e8 * Matrix7d::Identity();
  correct(filled, {loop}, chain_options());
  const MapSnapshot& map = filled.map.view();
  CHECK(worst_position_error(map, truth) < 0.25 * before);
  const Rigid3d end = map.at(KeyframeId(23)).cam_from_world;
  CHECK((end.params - truth.cam_from_world[23].params).norm() < 1e-3);
  for (const LandmarkId id : map.landmark_ids()) {
    CHECK((in_reference(map, id) - in_reference(*old, id)).norm() < 1e-9);
  }
}

TEST_CASE("loop graph: what lies before the loop is held, and would not have moved") {
  FilledMap filled = circle_map();
  const MapTruth truth = truth_of(filled.map.view());
  let_drift(filled.map, truth, small_drift(), 1);
  const MapSnapshot& map = filled.map.view();
  PoseConstraint loop = measured(truth, 12, 23);
  const ProblemConfig bounded = make_loop_graph(map, {loop}, chain_options());
  CHECK(bounded.variable_poses.size() == 13);  // and the one before the loop
  CHECK(bounded.fixed_poses.size() == 11);
  ProblemConfig whole = bounded;
  whole.fixed_poses = {map.origin()};
  whole.variable_poses = map.keyframe_ids();
  std::erase(whole.variable_poses, map.origin());
  whole.constraints = make_loop_graph(map, {}, chain_options()).constraints;
  whole.constraints.push_back(bounded.constraints.back());
  const BundleResult small = solve_bundle(map, bounded);
  const BundleResult large = solve_bundle(map, whole);
  REQUIRE(small.cam_from_world.size() == 13);
  REQUIRE(large.cam_from_world.size() == 23);
  for (std::size_t i = 0; i < 23; ++i) {
    const auto& [id, pose] = large.cam_from_world[i];
    const Rigid3d& expected =
        i < 10 ? map.at(id).cam_from_world : small.cam_from_world[i - 10].second;
    CHECK((pose.params - expected.params).norm() < 1e-5);
  }
}

TEST_CASE("loop graph: drift of scale takes similarities") {
  FilledMap filled = circle_map();
  const MapTruth truth = truth_of(filled.map.view());
  constexpr double kGrowth = 1.02;
  let_drift(filled.map, truth, Vector6d::Zero(), kGrowth);
  const double before = worst_position_error(filled.map.view(), truth);
  REQUIRE(before > 0.5);
  PoseConstraint loop = measured(truth, 0, 23);
  // The last camera sees everything larger.
  const Sim3d shrink(Eigen::Quaterniond::Identity(), Eigen::Vector3d::Zero(),
                     std::pow(kGrowth, -23));
  loop.a_from_b = loop.a_from_b * shrink;
  loop.information = 1e8 * Matrix7d::Identity();
  LoopGraphOptions options = chain_options();
  options.with_scale = true;
  options.metric_scale_sigma = options.scale_sigma;  // as if the cameras were single ones
  options.problem.loop_loss = Loss::kNone;  // so far off, and so sure, it would be taken as false
  correct(filled, {loop}, options);
  CHECK(worst_position_error(filled.map.view(), truth) < 0.1 * before);
  CHECK(worst_point_error(filled.map.view(), truth) < 0.2);
}

TEST_CASE("loop graph: one false loop among true ones does not bend the map") {
  FilledMap filled = circle_map();
  const MapTruth truth = truth_of(filled.map.view());
  let_drift(filled.map, truth, 0.3 * small_drift(), 1);
  std::vector<PoseConstraint> loops{measured(truth, 0, 23), measured(truth, 1, 22),
                                    measured(truth, 2, 21)};
  FilledMap without = circle_map();
  let_drift(without.map, truth, 0.3 * small_drift(), 1);
  correct(without, loops, chain_options());
  const double honest = worst_position_error(without.map.view(), truth);

  PoseConstraint wrong = measured(truth, 4, 14);
  wrong.a_from_b = Sim3d(se3_exp(Vector6d::Constant(0.8)));
  loops.push_back(wrong);
  correct(filled, loops, chain_options());
  CHECK(worst_position_error(filled.map.view(), truth) < honest + 0.02);
}

}  // namespace
}  // namespace hybrid_slam
