#include "backend/map/covisibility.h"

#include <algorithm>
#include <stdexcept>

namespace hybrid_slam {

namespace {

auto place_of(std::vector<Covisible>& edges, KeyframeId id) {
  return std::lower_bound(edges.begin(), edges.end(), id,
                          [](const Covisible& edge, KeyframeId key) { return edge.id < key; });
}

void change_weight(Keyframe& keyframe, KeyframeId other, int change) {
  auto& edges = keyframe.covisible;
  auto edge = place_of(edges, other);
  if (edge == edges.end() || edge->id != other) edge = edges.insert(edge, {other, 0});
  edge->shared_landmarks += change;
  if (edge->shared_landmarks < 0) throw std::logic_error("covisibility: negative weight");
  if (edge->shared_landmarks == 0) edges.erase(edge);
}

}  // namespace

void CovisibilityChanges::add(KeyframeId keyframe, const std::vector<Observation>& others,
                              int change) {
  for (const Observation& other : others) {
    if (other.keyframe == keyframe) continue;
    const auto [low, high] = std::minmax(keyframe.value, other.keyframe.value);
    changes_[(std::uint64_t{low} << 32) | high] += change;
  }
}

void CovisibilityChanges::write(PersistentTable<Keyframe>& keyframes) {
  // In whatever order the hash gives: sums of integers do not depend on it.
  for (const auto& [pair, change] : changes_) {
    if (change == 0) continue;
    const KeyframeId low(static_cast<std::uint32_t>(pair >> 32));
    const KeyframeId high(static_cast<std::uint32_t>(pair));
    change_weight(keyframes.edit(low.value), high, change);
    change_weight(keyframes.edit(high.value), low, change);
  }
  changes_.clear();
}

int shared_landmarks(const Keyframe& keyframe, KeyframeId other) {
  const auto& edges = keyframe.covisible;
  const auto edge = std::lower_bound(edges.begin(), edges.end(), other,
                                     [](const Covisible& e, KeyframeId key) { return e.id < key; });
  return edge != edges.end() && edge->id == other ? edge->shared_landmarks : 0;
}

KeyframeId strongest_covisible(const Keyframe& keyframe) {
  Covisible best;
  for (const Covisible& edge : keyframe.covisible) {
    if (edge.shared_landmarks > best.shared_landmarks) best = edge;
  }
  return best.id;
}

}  // namespace hybrid_slam
