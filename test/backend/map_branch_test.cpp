#include <memory>
#include <utility>
#include <vector>

#include "cameras/geometry/se3.h"
#include "test/backend/same_map.h"
#include "test/support/random_edits.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

FilledMap make_map() {
  SyntheticSceneOptions options;
  options.times = 12;
  options.landmarks = 600;
  options.fisheye = true;
  return fill_map(make_synthetic_scene(options), {});
}

// The same at each call.
void edit(FilledMap& filled, std::uint64_t seed) {
  RandomEdits edits(filled, seed, false);
  for (int i = 0; i < 50; ++i) edits.step();
}

// All keyframes but every fifth, and every second landmark that was there from the beginning.
struct Moves {
  std::vector<std::pair<KeyframeId, Rigid3d>> poses;
  std::vector<std::pair<LandmarkId, Eigen::Vector3d>> points;

  explicit Moves(std::uint64_t seed) {
    const FilledMap filled = make_map();
    Random random(seed);
    for (const KeyframeId id : filled.keyframes) {
      const Rigid3d pose = filled.map.view().at(id).cam_from_world;
      const Rigid3d moved = se3_exp(random.vector(6, 0.05)) * pose;
      if (id.value % 5 != 0) poses.emplace_back(id, moved);
    }
    for (const LandmarkId id : filled.map.view().landmark_ids()) {
      const Eigen::Vector3d by = random.gaussian3(0.1);
      if (id.value % 2 != 0) points.emplace_back(id, filled.map.view().at(id).point_in_world + by);
    }
  }
};

TEST_CASE("A map that was moved beside is as if it had been moved before what came meanwhile") {
  FilledMap beside = make_map();
  FilledMap in_order = make_map();
  std::vector<std::shared_ptr<const MapSnapshot>> snapshots;
  FilledMap without_moves = make_map();
  std::vector<std::shared_ptr<const MapSnapshot>> wanted;
  for (std::uint64_t round = 0; round < 3; ++round) {
    const Moves moves(10 + round);
    const auto then = beside.map.snapshot();
    Map branch = beside.map.branch();
    edit(beside, round);
    if (round == 0) {  // taken between the branch and its end, it stays as it is
      edit(without_moves, round);
      snapshots.push_back(beside.map.snapshot());
      wanted.push_back(without_moves.map.snapshot());
    }
    branch.move(moves.poses, moves.points);
    beside.map.take_in_moves(*then, std::move(branch));

    in_order.map.move(moves.poses, moves.points);
    edit(in_order, round);
    check_same_map(beside.map.view(), in_order.map.view());
    CHECK(beside.map.check_consistency() == std::vector<std::string>{});
    snapshots.push_back(beside.map.snapshot());
    wanted.push_back(in_order.map.snapshot());
  }
  for (std::size_t i = 0; i < snapshots.size(); ++i) check_same_map(*snapshots[i], *wanted[i]);
}

TEST_CASE("A keyframe that came while a map was moved beside is still there, where it was") {
  FilledMap filled = make_map();
  const auto then = filled.map.snapshot();
  Map branch = filled.map.branch();
  const Keyframe& last = filled.map.view().at(filled.keyframes.back());
  NewKeyframe made{last.observations, last.cam_from_world, last.landmarks, {}, last.id};
  const KeyframeId newcomer = filled.map.add_keyframe(made);
  MapEdit erased;
  erased.erased_keyframes = {filled.keyframes[3]};
  filled.map.apply(erased);

  const Moves moves(1);
  branch.move(moves.poses, moves.points);
  filled.map.take_in_moves(*then, std::move(branch));
  CHECK(filled.map.view().at(newcomer).cam_from_world.params == made.cam_from_world.params);
  CHECK(filled.map.view().find(filled.keyframes[3]) == nullptr);
  for (const auto& [id, pose] : moves.poses) {
    if (id != filled.keyframes[3]) {
      CHECK(filled.map.view().at(id).cam_from_world.params == pose.params);
    }
  }
  CHECK(filled.map.check_consistency() == std::vector<std::string>{});
}

}  // namespace
}  // namespace hybrid_slam
