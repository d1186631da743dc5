#include "backend/map/odometry.h"

#include <Eigen/Cholesky>

#include <catch2/catch.hpp>

#include "backend/backend.h"
#include "backend/problem/loop_graph.h"
#include "backend/problem/odometry_constraints.h"
#include "backend/problem/solve_graph.h"
#include "cameras/geometry/se3.h"
#include "cameras/geometry/uncertain_motion.h"
#include "test/support/filled_map.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

FilledMap map_with_odometry(bool fisheye = false) {
  SyntheticSceneOptions options;
  options.times = 8;
  options.landmarks = 400;
  options.fisheye = fisheye;
  FillOptions fill;
  fill.odometry = true;
  return fill_map(make_synthetic_scene(options), fill);
}

void erase(Map& map, KeyframeId id) {
  MapEdit edit;
  edit.erased_keyframes = {id};
  map.apply(edit);
}

TEST_CASE("Keyframes of one camera form a chain, whatever comes between them") {
  const FilledMap filled = map_with_odometry(true);
  const MapSnapshot& map = filled.map.view();
  for (std::size_t i = 0; i < filled.keyframes.size(); ++i) {
    const auto& odometry = map.at(filled.keyframes[i]).odometry;
    if (i < 2) {
      CHECK(odometry == nullptr);
    } else {
      REQUIRE(odometry != nullptr);
      CHECK(odometry->previous == filled.keyframes[i - 2]);
    }
  }
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
}

TEST_CASE("Odometry that does not begin at the keyframe before is left out, a wrong one refused") {
  FilledMap filled = map_with_odometry();
  const Keyframe& last = filled.map.view().at(filled.keyframes.back());
  NewKeyframe made{last.observations, last.cam_from_world, {}, {}, last.id};
  Odometry odometry = *last.odometry;  // from the one before the last
  made.odometry = std::make_shared<const Odometry>(odometry);
  CHECK(filled.map.view().at(filled.map.add_keyframe(made)).odometry == nullptr);
  const auto refused = [&] {
    made.odometry = std::make_shared<const Odometry>(odometry);
    CHECK_THROWS_AS(filled.map.add_keyframe(made), std::logic_error);
  };
  odometry.motion.covariance(2, 2) = -1;
  refused();
  odometry = *last.odometry;
  odometry.motion.covariance(2, 1) = 1e-9;  // not symmetric
  refused();
  odometry = *last.odometry;
  odometry.keypoints.back() = 100000;
  refused();
  odometry.keypoints = {3, 3};
  refused();
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
}

TEST_CASE("Where a keyframe is culled, the one after it goes on from the one before it") {
  FilledMap filled = map_with_odometry(true);
  const std::vector<KeyframeId>& ids = filled.keyframes;
  const auto first = filled.map.view().at(ids[4]).odometry;
  const auto second = filled.map.view().at(ids[6]).odometry;
  erase(filled.map, ids[4]);
  const auto both = filled.map.view().at(ids[6]).odometry;
  REQUIRE(both != nullptr);
  CHECK(both->previous == ids[2]);
  CHECK(both->keypoints == second->keypoints);
  const UncertainMotion expected = second->motion * first->motion;
  CHECK(both->motion.b_from_a.params == expected.b_from_a.params);
  CHECK(both->motion.covariance == expected.covariance);
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
}

TEST_CASE("Where the chain is broken before a keyframe that is culled, it is after it") {
  FilledMap filled = map_with_odometry();
  const std::vector<KeyframeId>& ids = filled.keyframes;
  const Keyframe& last = filled.map.view().at(ids.back());
  NewKeyframe lost{last.observations, last.cam_from_world, {}, {}, last.id};
  const KeyframeId broken = filled.map.add_keyframe(lost);
  NewKeyframe next = lost;
  next.odometry = std::make_shared<const Odometry>(
      Odometry{broken, {Rigid3d(), Vector6d::Constant(1e-4).asDiagonal()}, {}});
  const KeyframeId after = filled.map.add_keyframe(next);
  REQUIRE(filled.map.view().at(after).odometry != nullptr);
  erase(filled.map, broken);
  CHECK(filled.map.view().at(after).odometry == nullptr);
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
}

TEST_CASE("The share of odometry that counts is that of what is no landmark of both") {
  FilledMap filled = map_with_odometry();
  const KeyframeId id = filled.keyframes[3];
  const Keyframe before = filled.map.view().at(id);
  std::vector<LandmarkId> shared;
  for (const std::uint32_t keypoint : before.odometry->keypoints) {
    const LandmarkId landmark = before.landmarks[keypoint];
    if (!landmark.valid()) continue;
    const auto& seen = filled.map.view().at(landmark).observations;
    if (std::any_of(seen.begin(), seen.end(), [&](const Observation& o) {
          return o.keyframe == before.odometry->previous;
        })) {
      shared.push_back(landmark);
    }
  }
  const auto all = static_cast<double>(before.odometry->keypoints.size());
  REQUIRE(shared.size() > 10);
  CHECK(unshared(filled.map.view(), before) ==
        Approx(1 - static_cast<double>(shared.size()) / all).margin(1e-12));
  MapEdit edit;
  edit.erased_landmarks = shared;
  filled.map.apply(edit);
  CHECK(unshared(filled.map.view(), filled.map.view().at(id)) == 1);
  CHECK(unshared(filled.map.view(), filled.map.view().at(filled.keyframes[0])) == 0);
}

// The term's chi2 is the squared error of the motion by its covariance, times the share.
TEST_CASE("The term of odometry weighs what the odometer is off by") {
  Random random(4);
  FilledMap filled = map_with_odometry();
  Keyframe keyframe = filled.map.view().at(filled.keyframes[2]);
  Odometry odometry = *keyframe.odometry;
  Matrix6d root;
  for (double& x : root.reshaped()) x = random.uniform(-1, 1);
  odometry.motion.b_from_a = random.rigid(1, 1);
  odometry.motion.covariance = 1e-6 * (root * root.transpose() + Matrix6d::Identity());
  odometry.motion.covariance =
      (0.5 * (odometry.motion.covariance + odometry.motion.covariance.transpose())).eval();
  keyframe.odometry = std::make_shared<const Odometry>(odometry);
  const auto constraint = odometry_constraint(keyframe, 0.25);
  REQUIRE(constraint);
  CHECK(constraint->a == keyframe.id);
  CHECK(constraint->b == odometry.previous);
  CHECK_FALSE(constraint->loop);
  const Vector6d off = random.vector(6, 1e-3);
  FactorGraph graph;
  graph.frames = {{se3_exp(off) * odometry.motion.b_from_a}, {}};
  GraphEdge edge{0, 1, without_scale(constraint->a_from_b),
                 constraint->information.topLeftCorner<6, 6>()};
  const double expected = squared_mahalanobis(off, odometry.motion.covariance);
  CHECK(chi2(graph, edge) == Approx(0.25 * expected).epsilon(1e-2));
  CHECK_FALSE(odometry_constraint(keyframe, 0));
}

TEST_CASE("Every problem of a map has its odometry") {
  const FilledMap filled = map_with_odometry(true);
  const MapSnapshot& map = filled.map.view();
  const auto joins = [](const std::vector<PoseConstraint>& constraints, KeyframeId a,
                        KeyframeId b) {
    return std::any_of(constraints.begin(), constraints.end(), [&](const PoseConstraint& one) {
      return std::minmax(one.a, one.b) == std::minmax(a, b);
    });
  };
  const auto full = make_full_bundle(map, {}).constraints;
  const auto loop = make_loop_graph(map, {}, {.min_shared_landmarks = 100000}).constraints;
  int joined = 0;
  for (const KeyframeId id : map.keyframe_ids()) {
    const auto& odometry = map.at(id).odometry;
    if (odometry == nullptr) continue;
    ++joined;
    CHECK(joins(full, id, odometry->previous));
    CHECK(joins(loop, id, odometry->previous));
    CHECK(joins(make_local_bundle(map, id, {}).constraints, id, odometry->previous));
  }
  CHECK(joined > 10);
  CHECK(full.size() == static_cast<std::size_t>(joined));
}

}  // namespace
}  // namespace hybrid_slam
