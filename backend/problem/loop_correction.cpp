#include "backend/problem/loop_correction.h"

#include <algorithm>
#include <iterator>
#include <optional>

namespace hybrid_slam {

namespace {

// new_world_from_old_world of keyframes, by their ids, which are dense: thousands of landmarks ask.
template <typename Transform>
class MovesOf {
 public:
  explicit MovesOf(const MapSnapshot& map) : moves_(map.next_keyframe_id().value) {}

  void add(KeyframeId id, const Transform& new_from_old) { moves_[id.value] = new_from_old; }

  // Null where none was added.
  const Transform* find(KeyframeId id) const {
    const bool known = id.value < moves_.size() && moves_[id.value];
    return known ? &*moves_[id.value] : nullptr;
  }

 private:
  std::vector<std::optional<Transform>> moves_;
};

using Moves = MovesOf<Rigid3d>;

// Of those that a result moves.
Moves moves_of(const MapSnapshot& now, const BundleResult& result) {
  Moves moves(now);
  for (const auto& [id, cam_from_new] : result.cam_from_world) {
    const Keyframe* keyframe = now.find(id);
    if (keyframe != nullptr) moves.add(id, inverse(cam_from_new) * keyframe->cam_from_world);
  }
  return moves;
}

// The same, and of keyframes that hang from these.
class Carrier {
 public:
  Carrier(const MapSnapshot& now, const BundleResult& result)
      : now_(now), new_from_old_(moves_of(now, result)) {
    if (!moved(now.origin())) new_from_old_.add(now.origin(), Rigid3d());
  }

  bool moved(KeyframeId id) const { return new_from_old_.find(id) != nullptr; }

  const Rigid3d& new_from_old(KeyframeId id) const {
    while (!moved(id)) id = now_.at(id).parent;  // ends at the origin
    return *new_from_old_.find(id);
  }

 private:
  const MapSnapshot& now_;
  Moves new_from_old_;
};

}  // namespace

void write_loop_correction(const MapSnapshot& map, const MapGraph& solved, BundleResult& result) {
  const FactorGraph& graph = solved.graph;
  MovesOf<Sim3d> moves(map);
  result.cam_from_world.clear();
  for (std::size_t i = 0; i < solved.frames.size(); ++i) {
    const bool scaled = !graph.similarities.empty();
    if (scaled ? graph.similarities[i].fixed : graph.frames[i].fixed) continue;
    const Sim3d cam_from_new =
        scaled ? graph.similarities[i].cam_from_world : Sim3d(graph.frames[i].cam_from_world);
    const KeyframeId id = solved.frames[i];
    const Sim3d cam_from_old(map.at(id).cam_from_world);
    const Sim3d new_from_old = inverse(cam_from_new) * cam_from_old;
    moves.add(id, new_from_old);
    result.cam_from_world.emplace_back(id, without_scale(cam_from_old * inverse(new_from_old)));
  }
  for (const LandmarkId id : map.landmark_ids()) {
    const Landmark& landmark = map.at(id);
    if (const Sim3d* new_from_old = moves.find(landmark.reference)) {
      result.point_in_world.emplace_back(id, *new_from_old * landmark.point_in_world);
    }
  }
}

LoopMove move_of(const MapSnapshot& before, const BundleResult& correction) {
  LoopMove move;
  for (const auto& [id, cam_from_new] : correction.cam_from_world) {
    const Keyframe* keyframe = before.find(id);
    if (keyframe == nullptr) continue;
    move.emplace_back(id, inverse(cam_from_new) * keyframe->cam_from_world);
  }
  std::sort(move.begin(), move.end(),
            [](const auto& a, const auto& b) { return a.first < b.first; });
  return move;
}

void carry_over(const LoopMove& move, const MapSnapshot& now, BundleResult& result) {
  Moves moves(now);
  for (const auto& [id, new_from_old] : move) moves.add(id, new_from_old);
  for (auto& [id, cam_from_world] : result.cam_from_world) {
    if (const Rigid3d* new_from_old = moves.find(id)) {
      cam_from_world = cam_from_world * inverse(*new_from_old);
    }
  }
  for (auto& [id, point_in_world] : result.point_in_world) {
    const Landmark* landmark = now.find(id);
    const Rigid3d* new_from_old = landmark != nullptr ? moves.find(landmark->reference) : nullptr;
    if (new_from_old != nullptr) point_in_world = *new_from_old * point_in_world;
  }
}

void carry_the_rest(const MapSnapshot& now, BundleResult& result) {
  const Carrier carrier(now, result);
  for (const KeyframeId id : now.keyframe_ids()) {
    if (carrier.moved(id)) continue;
    const Rigid3d cam_from_new =
        now.at(id).cam_from_world * inverse(carrier.new_from_old(now.at(id).parent));
    result.cam_from_world.emplace_back(id, cam_from_new);
  }
  std::vector<LandmarkId> known;
  known.reserve(result.point_in_world.size());
  for (const auto& [id, point] : result.point_in_world) known.push_back(id);
  std::sort(known.begin(), known.end());
  const std::vector<LandmarkId> all = now.landmark_ids();
  std::vector<LandmarkId> others;
  std::set_difference(all.begin(), all.end(), known.begin(), known.end(),
                      std::back_inserter(others));
  for (const LandmarkId id : others) {
    const Landmark& landmark = now.at(id);
    result.point_in_world.emplace_back(
        id, carrier.new_from_old(landmark.reference) * landmark.point_in_world);
  }
}

void carry_newcomers(const MapSnapshot& then, const MapSnapshot& now, BundleResult& result) {
  const KeyframeId first = then.next_keyframe_id();
  if (now.next_keyframe_id() == first) return;
  Moves moves = moves_of(now, result);
  for (const KeyframeId id : now.keyframe_ids_from(first)) {
    // Where a keyframe was erased meanwhile, one may hang from one that is newer.
    KeyframeId above = now.at(id).parent;
    while (above >= first && moves.find(above) == nullptr) above = now.at(above).parent;
    if (moves.find(above) == nullptr) continue;
    const Rigid3d new_from_old = *moves.find(above);
    result.cam_from_world.emplace_back(id, now.at(id).cam_from_world * inverse(new_from_old));
    moves.add(id, new_from_old);
  }
  for (const LandmarkId id : now.changed_landmarks(then)) {
    const Landmark* landmark = then.find(id) == nullptr ? now.find(id) : nullptr;
    if (landmark == nullptr) continue;
    const Rigid3d* new_from_old = moves.find(landmark->reference);
    if (new_from_old == nullptr) continue;
    result.point_in_world.emplace_back(id, *new_from_old * landmark->point_in_world);
  }
}

}  // namespace hybrid_slam
