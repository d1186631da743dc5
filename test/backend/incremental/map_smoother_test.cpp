#include "backend/incremental/map_smoother.h"

#include <algorithm>
#include <tuple>
#include <vector>

#include "backend/backend.h"
#include "backend/problem/odometry_constraints.h"
#include "backend/problem/solve_graph.h"
#include "cameras/geometry/se3.h"
#include "cameras/geometry/so3.h"
#include "test/support/random_edits.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

// What tells observations apart: the keypoint's place.
using Place = std::tuple<double, double>;

std::vector<Place> observed(const MapSnapshot& map) {
  std::vector<Place> places;
  for (const LandmarkId id : map.landmark_ids()) {
    for (const Observation& seen : map.at(id).observations) {
      const Keypoint& keypoint =
          map.at(seen.keyframe).observations->features.keypoints[seen.keypoint];
      places.emplace_back(keypoint.x, keypoint.y);
    }
  }
  std::sort(places.begin(), places.end());
  return places;
}

std::vector<Place> observed(const FactorGraph& graph) {
  std::vector<Place> places;
  for (const GraphObservation& seen : graph.observations) {
    places.emplace_back(seen.measurement.x(), seen.measurement.y());
  }
  std::sort(places.begin(), places.end());
  return places;
}

bool has_motion(const std::vector<GraphEdge>& edges, const Rigid3d& motion) {
  return std::any_of(edges.begin(), edges.end(), [&](const GraphEdge& edge) {
    return (edge.a_from_b.params - motion.params).norm() < 1e-12;
  });
}

// Every edge is odometry of the map, and what odometry says beyond the landmarks is an edge.
void check_odometry(const MapSnapshot& map, const FactorGraph& graph) {
  std::size_t edges = 0;
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    if (keyframe.odometry == nullptr) continue;
    const bool there = has_motion(graph.edges, keyframe.odometry->motion.b_from_a);
    edges += there ? 1 : 0;
    if (unshared(map, keyframe) > 0.11) CHECK(there);
  }
  CHECK(edges == graph.edges.size());
}

TEST_CASE(
    "A smoother holds the observations and the odometry that the map holds, after any edits") {
  SyntheticSceneOptions options;
  options.times = 12;
  options.landmarks = 600;
  options.fisheye = true;
  FillOptions fill;
  fill.odometry = true;
  FilledMap filled = fill_map(make_synthetic_scene(options), fill);
  RandomEdits edits(filled, 5);
  MapSmootherOptions lenient;  // only what does not project is an outlier
  lenient.solver.chi2_mono = lenient.solver.chi2_stereo = 1e300;
  MapSmoother smoother(lenient);
  const KeyframeId newest = filled.keyframes.back();
  filled.map.set_keep(newest);
  for (int i = 0; i < 40; ++i) {
    BundleResult result;
    do {
      result = smoother.update(filled.map.snapshot(), newest);
      MapEdit outliers;
      outliers.erased_observations = result.outliers;
      filled.map.apply(outliers);
    } while (!result.outliers.empty());
    CHECK((observed(smoother.solver().graph()) == observed(filled.map.view())));
    check_odometry(filled.map.view(), smoother.solver().graph());
    for (int k = 0; k < 10; ++k) edits.step();
  }
}

TEST_CASE("Odometry weighs as much as the landmarks leave to it, and less where they come") {
  SyntheticSceneOptions options;
  options.times = 24;
  options.landmarks = 1500;
  FillOptions fill;
  fill.odometry = true;
  FilledMap filled = fill_map(make_synthetic_scene(options), fill);
  const KeyframeId id = filled.keyframes[2];
  const auto weight = [&](const MapSmoother& smoother) {
    const Keyframe& keyframe = filled.map.view().at(id);
    const auto whole = odometry_constraint(keyframe, 1);
    for (const GraphEdge& edge : smoother.solver().graph().edges) {
      if (!has_motion({edge}, keyframe.odometry->motion.b_from_a)) continue;
      return edge.information.trace() / whole->information.topLeftCorner<6, 6>().trace();
    }
    return 0.0;
  };
  MapSmoother smoother(MapSmootherOptions{});
  smoother.update(filled.map.snapshot(), filled.keyframes.back());
  const double before = unshared(filled.map.view(), filled.map.view().at(id));
  REQUIRE(before < 0.8);
  CHECK(weight(smoother) == Approx(before));
  MapEdit edit;
  for (const LandmarkId landmark : filled.map.view().at(id).landmarks) {
    if (landmark.valid()) edit.erased_landmarks.push_back(landmark);
  }
  filled.map.apply(edit);
  smoother.update(filled.map.snapshot(), filled.keyframes.back());
  CHECK(weight(smoother) == Approx(1));
}

TEST_CASE("An observation that was set aside and is taken in again is given back to the solver") {
  SyntheticSceneOptions options;
  options.times = 24;
  options.landmarks = 1500;
  options.outlier_rate = 0.02;
  FilledMap filled = fill_map(make_synthetic_scene(options), {});
  MapSmoother smoother(MapSmootherOptions{});
  const KeyframeId newest = filled.keyframes.back();
  const BundleResult result = smoother.update(filled.map.snapshot(), newest);
  REQUIRE(result.outliers.size() > 3);
  CHECK(observed(smoother.solver().graph()).size() + result.outliers.size() ==
        observed(filled.map.view()).size());
  // The map lets go of them and finds them again before the smoother looks.
  MapEdit back;
  back.erased_observations = result.outliers;
  filled.map.apply(back);
  back = {};
  back.new_observations = result.outliers;
  filled.map.apply(back);
  const std::size_t held = observed(filled.map.view()).size();
  // What an older keyframe sees of them is set aside anew; the others are held.
  const BundleResult again = smoother.update(filled.map.snapshot(), filled.keyframes[12]);
  CHECK(again.outliers.size() < result.outliers.size());
  CHECK(observed(smoother.solver().graph()).size() + again.outliers.size() == held);
}

TEST_CASE("A smoother follows a map that others moved, and takes back what is not right") {
  SyntheticSceneOptions options;
  options.times = 24;
  options.landmarks = 1500;
  FilledMap filled = fill_map(make_synthetic_scene(options), {});
  MapSmootherOptions lenient;  // no outliers
  lenient.solver.chi2_mono = lenient.solver.chi2_stereo = 1e300;
  MapSmoother smoother(lenient);
  const auto update = [&](int times) {
    for (int i = 0; i < times; ++i) {
      const BundleResult result = smoother.update(filled.map.snapshot(), filled.keyframes.back());
      filled.map.move(result.cam_from_world, result.point_in_world);
    }
  };
  update(10);
  const auto settled = filled.map.snapshot();
  std::vector<std::pair<KeyframeId, Rigid3d>> moves;
  const Rigid3d by(so3_exp(Eigen::Vector3d(0.02, 0.01, -0.03)), Eigen::Vector3d(0.1, 0.05, -0.05));
  for (std::size_t i = 8; i < 16; ++i) {
    const KeyframeId id = filled.keyframes[i];
    moves.emplace_back(id, settled->at(id).cam_from_world * inverse(by));
  }
  filled.map.move(moves, {});
  update(10);
  double worst = 0;
  for (const KeyframeId id : filled.keyframes) {
    worst = std::max(worst, (filled.map.view().at(id).cam_from_world.params -
                             settled->at(id).cam_from_world.params)
                                .norm());
  }
  CHECK(worst < 1e-3);
}

// Grows a map as the pipeline does, from poses and points that are off.
std::vector<Rigid3d> grow(const SyntheticScene& scene, Backend& backend, double pose_noise) {
  Random random(3);
  for (const Camera& camera : scene.cameras) backend.add_camera(camera);
  std::vector<LandmarkId> born(scene.points_in_world.size());
  Rigid3d previous_estimate;
  Rigid3d previous_truth;
  std::vector<Rigid3d> truth;
  for (const SyntheticFrame& frame : scene.frames) {
    Rigid3d start = frame.cam_from_world * inverse(previous_truth) * previous_estimate;
    if (!truth.empty()) start.params.tail<3>() += random.gaussian3(pose_noise);
    NewKeyframe made{frame.observations, start, {}, {}, backend.view().origin()};
    made.landmarks.resize(frame.landmark.size());
    for (std::uint32_t k = 0; k < frame.landmark.size(); ++k) {
      const auto index = static_cast<std::size_t>(frame.landmark[k]);
      made.landmarks[k] = born[index];
      if (born[index].valid() || !frame.observations->has_right(k)) continue;
      const Eigen::Vector3d in_cam = frame.cam_from_world * scene.points_in_world[index];
      made.new_points.emplace_back(k, inverse(start) * (in_cam + random.gaussian3(0.02)));
    }
    const KeyframeId id = backend.add(made);
    for (std::size_t k = 0; k < frame.landmark.size(); ++k) {
      const LandmarkId landmark = backend.view().at(id).landmarks[k];
      if (landmark.valid()) born[static_cast<std::size_t>(frame.landmark[k])] = landmark;
    }
    backend.optimize_local(id);
    previous_truth = frame.cam_from_world;
    previous_estimate = backend.view().at(id).cam_from_world;
    truth.push_back(frame.cam_from_world);
  }
  return truth;
}

double worst_position_error(const MapSnapshot& map, const std::vector<Rigid3d>& truth) {
  double worst = 0;
  for (const KeyframeId id : map.keyframe_ids()) {
    const Eigen::Vector3d at = inverse(map.at(id).cam_from_world).translation();
    worst = std::max(worst, (at - inverse(truth[id.value]).translation()).norm());
  }
  return worst;
}

TEST_CASE("A map grown with the smoother is as good as after bundle adjustment of everything") {
  SyntheticSceneOptions scene;
  scene.times = 25;
  scene.landmarks = 800;
  scene.outlier_rate = 0.02;
  BackendOptions options;
  options.local_method = LocalMethod::kIncremental;
  options.full.problem.rounds = {{50, Loss::kHuber, 1e-10}};
  Backend backend(options);
  const std::vector<Rigid3d> truth = grow(make_synthetic_scene(scene), backend, 0.01);
  backend.catch_up();
  const double grown = worst_position_error(backend.view(), truth);
  const BundleSummary full = backend.optimize_full();
  const double adjusted = worst_position_error(backend.view(), truth);
  CHECK(full.initial_cost < 1.02 * full.final_cost);
  CHECK(full.observations > 2000);
  CHECK(grown < 1.1 * adjusted);
  CHECK(adjusted < 0.05);
}

double off(const MapSnapshot& map, const MapSmoother& smoother, KeyframeId id) {
  // Poses of the solver are numbered as the keyframes are.
  return (smoother.solver().pose(id.value).params - map.at(id).cam_from_world.params).norm();
}

// A long row of keyframes, all but the newest ones moved aside by others: the smoother finds them
// back where they were.
struct MovedAside {
  FilledMap filled = make_row();
  KeyframeId newest = filled.keyframes.back();
  MapSmoother smoother{without_outliers()};
  std::vector<std::pair<KeyframeId, Rigid3d>> aside;

  MovedAside() {
    take_in(smoother.update(filled.map.snapshot(), newest));
    CHECK(smoother.rest(filled.map.view()).cam_from_world.empty());  // a new map: all of it
    for (const KeyframeId id : filled.keyframes) {
      if (id == filled.map.view().origin() || id == newest) continue;
      Rigid3d pose = filled.map.view().at(id).cam_from_world;
      pose.params.tail<3>() += 0.02 * Eigen::Vector3d::Unit(id.value % 3);
      aside.emplace_back(id, pose);
    }
    filled.map.move(aside, {});
  }
  BundleResult take_in(const BundleResult& result) {
    filled.map.move(result.cam_from_world, result.point_in_world);
    return result;
  }

  static FilledMap make_row() {
    SyntheticSceneOptions options;
    options.trajectory = SceneTrajectory::kCorridor;
    options.times = 150;
    options.step = 3;
    options.landmarks = 6000;
    return fill_map(make_synthetic_scene(options), {});
  }
  static MapSmootherOptions without_outliers() {
    MapSmootherOptions lenient;
    lenient.solver.chi2_mono = lenient.solver.chi2_stereo = 1e300;
    return lenient;
  }
};

TEST_CASE("What moves far from the newest keyframes is told by and by, and at once when asked") {
  MovedAside row;
  FilledMap& filled = row.filled;
  MapSmoother& smoother = row.smoother;
  const KeyframeId newest = row.newest;
  const auto take_in = [&](const BundleResult& result) { return row.take_in(result); };
  auto& aside = row.aside;
  const Keyframe& last = filled.map.view().at(newest);
  const auto is_near = [&](KeyframeId id) {
    return id == newest || std::any_of(last.covisible.begin(), last.covisible.end(),
                                       [&](const Covisible& one) { return one.id == id; });
  };
  const std::size_t near_ones = last.covisible.size() + 1;
  REQUIRE(near_ones < filled.keyframes.size() / 3);

  const BundleResult first = take_in(smoother.update(filled.map.snapshot(), newest));
  std::size_t behind = 0;
  for (const KeyframeId id : filled.keyframes) {
    if (is_near(id))
      CHECK(off(filled.map.view(), smoother, id) < 2 * MapSmootherOptions().min_motion);
    behind += off(filled.map.view(), smoother, id) > 1e-3 ? 1 : 0;
  }
  CHECK(first.cam_from_world.size() < filled.keyframes.size() * 2 / 3);
  CHECK(behind > filled.keyframes.size() / 4);

  SECTION("by and by") {
    std::size_t updates = 0;
    while (behind > 0 && updates < 20) {
      take_in(smoother.update(filled.map.snapshot(), newest));
      ++updates;
      behind = 0;
      for (const KeyframeId id : filled.keyframes) {
        behind += off(filled.map.view(), smoother, id) > 1e-3 ? 1 : 0;
      }
    }
    CHECK(behind == 0);
    CHECK(updates > 1);
  }
  SECTION("not of a twentieth of a millimetre, but when asked") {
    take_in(smoother.rest(filled.map.view()));
    for (auto& [id, pose] : aside) {
      pose = filled.map.view().at(id).cam_from_world;
      if (!is_near(id)) pose.params.tail<3>() += 5e-5 * Eigen::Vector3d::Unit(id.value % 3);
    }
    filled.map.move(aside, {});
    const BundleResult next = take_in(smoother.update(filled.map.snapshot(), newest));
    for (const auto& [id, pose] : next.cam_from_world) CHECK(is_near(id));
    CHECK(smoother.rest(filled.map.view()).cam_from_world.size() > filled.keyframes.size() / 4);
  }
  SECTION("at once, but for what others have moved meanwhile") {
    KeyframeId moved;
    for (const KeyframeId id : filled.keyframes) {
      if (off(filled.map.view(), smoother, id) > 1e-3) moved = id;
    }
    Rigid3d by_others = filled.map.view().at(moved).cam_from_world;
    by_others.params.tail<3>() += Eigen::Vector3d(0.5, 0, 0);
    filled.map.move({{moved, by_others}}, {});
    const BundleResult rest = take_in(smoother.rest(filled.map.view()));
    CHECK(rest.cam_from_world.size() + 1 == behind);
    for (const KeyframeId id : filled.keyframes) {
      if (id != moved) CHECK(off(filled.map.view(), smoother, id) < 1e-3);
    }
    CHECK(filled.map.view().at(moved).cam_from_world.params == by_others.params);
    CHECK(smoother.rest(filled.map.view()).cam_from_world.empty());
  }
}

// Where the smoother has everything after others have turned the map, whether or not it was told
// all of what the smoother knew before.
std::vector<Rigid3d> moved_by_others(bool told) {
  MovedAside row;
  row.take_in(row.smoother.update(row.filled.map.snapshot(), row.newest));
  std::size_t behind = 0;
  for (const KeyframeId id : row.filled.keyframes) {
    behind += off(row.filled.map.view(), row.smoother, id) > 1e-3 ? 1 : 0;
  }
  CHECK(behind > row.filled.keyframes.size() / 4);
  if (told) row.take_in(row.smoother.rest(row.filled.map.view()));
  for (auto& [id, pose] : row.aside) {
    const double along = id.value / 150.0;  // like a bar that is bent
    pose = row.filled.map.view().at(id).cam_from_world *
           Rigid3d(so3_exp({0, 0.01 * along, 0}), {0.05 * along * along, 0, 0});
  }
  row.filled.map.move(row.aside, {});
  row.smoother.update(row.filled.map.snapshot(), row.newest);
  std::vector<Rigid3d> poses;
  for (const KeyframeId id : row.filled.keyframes) {
    poses.push_back(row.smoother.solver().pose(id.value));
  }
  return poses;
}

TEST_CASE("What the map was not told yet is kept when others move it") {
  const std::vector<Rigid3d> told = moved_by_others(true);
  const std::vector<Rigid3d> not_told = moved_by_others(false);
  for (std::size_t i = 0; i < told.size(); ++i) {
    CHECK(se3_log(inverse(told[i]) * not_told[i]).norm() < 1e-6);
  }
}

// What is handed out is enough to have any covariance without the solver, as the solver has it.
TEST_CASE("The covariances that a smoother hands out are those of its solver") {
  SyntheticSceneOptions scene;
  scene.times = 25;
  scene.landmarks = 800;
  Backend backend{BackendOptions()};
  grow(make_synthetic_scene(scene), backend, 0.01);
  const auto map = backend.snapshot();
  const std::vector<KeyframeId> ids = map->keyframe_ids();
  MapSmoother smoother{MapSmootherOptions()};
  smoother.update(map, ids.back());
  const auto handed_out = smoother.covariances(*map);
  int compared = 0;
  for (std::uint32_t i = 0; i < ids.size(); ++i) {
    if (!handed_out->knows(ids[i])) continue;
    const Matrix6d expected = smoother.solver().covariance(i);
    CHECK((handed_out->covariance(ids[i]) - expected).norm() <= 1e-9 * expected.norm());
    ++compared;
  }
  CHECK(compared >= 5);
  REQUIRE(handed_out->knows(ids.back()));

  // Of a difference: what both have in common is in it.
  const auto last = static_cast<std::uint32_t>(ids.size() - 1);
  const GraphVariable newest{GraphVariable::Kind::kPose, last};
  const GraphVariable before{GraphVariable::Kind::kPose, last - 1};
  const Eigen::MatrixXd both = smoother.solver().covariance({newest, before});
  Eigen::Matrix<double, 6, 12> difference;
  difference << Matrix6d::Identity(), -2 * Matrix6d::Identity();
  const Matrix6d expected = difference * both * difference.transpose();
  const std::vector<KeyframeCovariances::Derivative> derivatives = {
      {ids[last], Matrix6d::Identity()}, {ids[last - 1], -2 * Matrix6d::Identity()}};
  CHECK((handed_out->covariance(derivatives) - expected).norm() <= 1e-9 * expected.norm());
}

TEST_CASE("Snapshots tell how certain the newest keyframe is, where a smoother knows it") {
  SyntheticSceneOptions scene;
  scene.times = 25;
  scene.landmarks = 800;
  for (const LocalMethod method : {LocalMethod::kIncremental, LocalMethod::kBundle}) {
    BackendOptions options;
    options.local_method = method;
    Backend backend(options);
    CHECK_FALSE(backend.view().keyframe_covariance(KeyframeId(0)));
    grow(make_synthetic_scene(scene), backend, 0.01);
    const auto map = backend.snapshot();
    const auto newest = map->keyframe_covariance(map->keyframe_ids().back());
    CHECK(newest.has_value() == (method == LocalMethod::kIncremental));
    if (!newest) continue;
    CHECK(Eigen::LLT<Matrix6d>(*newest).info() == Eigen::Success);
    CHECK(map->keyframe_covariance(map->origin()) == Matrix6d(Matrix6d::Zero()));
  }
}

TEST_CASE("A smoother with a window goes on where keyframes were marginalised") {
  SyntheticSceneOptions scene;
  scene.times = 40;
  scene.landmarks = 800;
  BackendOptions options;
  options.local_method = LocalMethod::kIncremental;
  options.incremental.solver.window = 8;
  Backend backend(options);
  const std::vector<Rigid3d> truth = grow(make_synthetic_scene(scene), backend, 0.01);
  CHECK(backend.map().check_consistency() == std::vector<std::string>{});
  CHECK(worst_position_error(backend.view(), truth) < 0.05);
}

}  // namespace
}  // namespace hybrid_slam
