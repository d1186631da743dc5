#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "backend/map/landmark_attributes.h"
#include "backend/map/map.h"
#include "backend/map/odometry.h"

namespace hybrid_slam {

namespace {

// Gathers one line per fault.
class ConsistencyCheck {
 public:
  explicit ConsistencyCheck(const MapTables& tables) : tables_(tables) {}

  std::vector<std::string> run() {
    tables_.keyframes.for_each([&](std::uint64_t i, const Keyframe& k) { check_keyframe(i, k); });
    tables_.landmarks.for_each([&](std::uint64_t i, const Landmark& l) { check_landmark(i, l); });
    check_covisibility();
    check_tree();
    check_erased();
    return faults_;
  }

 private:
  void expect(bool condition, const char* kind, std::uint64_t id, const char* fault) {
    if (!condition) faults_.push_back(std::string(kind) + ' ' + std::to_string(id) + ": " + fault);
  }

  const Keyframe* find(KeyframeId id) const { return tables_.keyframes.find(id.value); }

  void check_keyframe(std::uint64_t index, const Keyframe& keyframe) {
    const auto check = [&](bool ok, const char* fault) { expect(ok, "keyframe", index, fault); };
    check(keyframe.id.value == index && index < tables_.next_keyframe, "wrong id");
    check(keyframe.observations->camera.value < tables_.cameras.size(), "unknown camera");
    check(keyframe.cam_from_world.params.allFinite(), "pose is not finite");
    check(keyframe.landmarks.size() == keyframe.observations->size(), "wrong number of landmarks");
    check_odometry(index, keyframe);
    for (std::uint32_t keypoint = 0; keypoint < keyframe.landmarks.size(); ++keypoint) {
      const LandmarkId id = keyframe.landmarks[keypoint];
      if (!id.valid()) continue;
      const Landmark* landmark = tables_.landmarks.find(id.value);
      check(landmark != nullptr, "sees a landmark that does not exist");
      if (landmark == nullptr) continue;
      const Observation observation{keyframe.id, keypoint};
      check(std::count(landmark->observations.begin(), landmark->observations.end(), observation) ==
                1,
            "sees a landmark that does not know of it");
    }
  }

  void check_odometry(std::uint64_t index, const Keyframe& keyframe) {
    if (keyframe.odometry == nullptr) return;
    const Odometry& odometry = *keyframe.odometry;
    const auto check = [&](bool ok, const char* fault) { expect(ok, "keyframe", index, fault); };
    check(odometry.previous.valid() && odometry.previous == keyframe_before(tables_, keyframe.id),
          "odometry that does not begin at the keyframe before");
    check(is_valid(odometry, keyframe.observations->size()),
          "odometry without a covariance, or by keypoints that are not there");
  }

  void check_landmark(std::uint64_t index, const Landmark& landmark) {
    const auto check = [&](bool ok, const char* fault) { expect(ok, "landmark", index, fault); };
    check(landmark.id.value == index && index < tables_.next_landmark, "wrong id");
    check(landmark.point_in_world.allFinite(), "point is not finite");
    check(landmark.visible >= 0 && landmark.found >= 0, "negative counter");
    bool linked = true;
    bool has_reference = false;
    KeyframeId previous;
    for (const Observation& observation : landmark.observations) {
      const Keyframe* keyframe = find(observation.keyframe);
      linked = linked && keyframe != nullptr && observation.keypoint < keyframe->landmarks.size() &&
               keyframe->landmarks[observation.keypoint] == landmark.id;
      check(!previous.valid() || previous < observation.keyframe, "observations are not in order");
      has_reference = has_reference || observation.keyframe == landmark.reference;
      previous = observation.keyframe;
    }
    check(linked, "observed by a keypoint that does not know of it");
    check(has_reference, "not seen by its reference");
    if (!linked || !has_reference) return;
    check(is_supported(tables_, landmark), "without support");
    check_derived(index, landmark);
  }

  void check_derived(std::uint64_t index, const Landmark& landmark) {
    Landmark fresh = landmark;
    update_appearance(tables_, fresh);
    update_geometry(tables_, fresh);
    expect(fresh.descriptor == landmark.descriptor, "landmark", index, "stale descriptor");
    expect((fresh.mean_direction - landmark.mean_direction).norm() < 1e-9, "landmark", index,
           "stale direction");
    expect(std::abs(fresh.object_scale - landmark.object_scale) <= 1e-9 * fresh.object_scale,
           "landmark", index, "stale scale");
  }

  void check_covisibility() {
    std::map<KeyframeId, std::map<KeyframeId, int>> shared;
    tables_.landmarks.for_each([&](std::uint64_t, const Landmark& landmark) {
      for (const Observation& a : landmark.observations) {
        for (const Observation& b : landmark.observations) {
          if (a.keyframe != b.keyframe) ++shared[a.keyframe][b.keyframe];
        }
      }
    });
    tables_.keyframes.for_each([&](std::uint64_t index, const Keyframe& keyframe) {
      std::vector<Covisible> expected;
      for (const auto& [id, weight] : shared[keyframe.id]) expected.push_back({id, weight});
      expect(keyframe.covisible == expected, "keyframe", index, "wrong covisibility");
    });
  }

  void check_tree() {
    if (tables_.keyframes.size() == 0) return;
    const Keyframe* origin = find(tables_.origin);
    expect(origin != nullptr && !origin->parent.valid(), "origin", tables_.origin.value,
           "missing or not the root");
    if (origin == nullptr) return;
    std::set<KeyframeId> reached;
    std::vector<KeyframeId> open{tables_.origin};
    while (!open.empty()) {
      const KeyframeId id = open.back();
      open.pop_back();
      if (!reached.insert(id).second) continue;
      const auto& children = find(id)->children;
      expect(std::is_sorted(children.begin(), children.end()), "keyframe", id.value,
             "children are not in order");
      for (const KeyframeId child : children) {
        const bool mutual = find(child) != nullptr && find(child)->parent == id;
        expect(mutual, "keyframe", id.value, "child does not know its parent");
        if (mutual) open.push_back(child);
      }
    }
    tables_.keyframes.for_each([&](std::uint64_t index, const Keyframe& keyframe) {
      expect(reached.contains(keyframe.id), "keyframe", index, "not in the spanning tree");
    });
  }

  void check_erased() {
    tables_.erased.for_each([&](std::uint64_t index, const ErasedKeyframe& erased) {
      expect(tables_.keyframes.find(index) == nullptr, "keyframe", index, "erased and alive");
      expect(erased.cam_from_parent.params.allFinite(), "keyframe", index, "tombstone not finite");
      expect(leads_home(KeyframeId(static_cast<std::uint32_t>(index))), "keyframe", index,
             "tombstone leads nowhere");
    });
  }

  // Whether the parents' parents of an erased keyframe end at a living one. Each step is taken once
  // in all, however long the chains.
  bool leads_home(KeyframeId id) {
    std::vector<KeyframeId> way;
    while (tables_.erased.find(id.value) != nullptr && !leads_home_.contains(id)) {
      way.push_back(id);
      leads_home_[id] = false;  // met again, it is a circle
      id = tables_.erased.find(id.value)->parent;
    }
    const auto known = leads_home_.find(id);
    const bool home = known != leads_home_.end() ? known->second : find(id) != nullptr;
    for (const KeyframeId passed : way) leads_home_[passed] = home;
    return home;
  }

  const MapTables& tables_;
  std::map<KeyframeId, bool> leads_home_;  // of erased keyframes
  std::vector<std::string> faults_;
};

}  // namespace

std::vector<std::string> Map::check_consistency() const {
  return ConsistencyCheck(view_.tables_).run();
}

}  // namespace hybrid_slam
