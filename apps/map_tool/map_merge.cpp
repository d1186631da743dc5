#include "apps/map_tool/map_merge.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "apps/map_tool/place_agreement.h"
#include "backend/map/components.h"
#include "backend/map/map_assembly.h"
#include "backend/problem/solve_bundle.h"
#include "cameras/files/input_error.h"

namespace hybrid_slam {
namespace {

// Adds the time that it lives to a stage.
class Stopwatch {
 public:
  explicit Stopwatch(MergeStageTime& stage) : stage_(stage) {}
  ~Stopwatch() {
    stage_.wall_s += std::chrono::duration<double>(Clock::now() - wall_).count();
    stage_.cpu_s += static_cast<double>(std::clock() - cpu_) / CLOCKS_PER_SEC;
  }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  using Clock = std::chrono::steady_clock;
  MergeStageTime& stage_;
  Clock::time_point wall_ = Clock::now();
  std::clock_t cpu_ = std::clock();
};

// Without keyframes that nothing measured holds: no landmark is shared, no odometry leads there.
MapPart whole(const MapSnapshot& map) {
  MapPart part;
  part.map = &map;
  for (const KeyframeId id : map.keyframe_ids()) {
    const Keyframe& keyframe = map.at(id);
    const bool held = !keyframe.covisible.empty() || keyframe.odometry != nullptr;
    if (held || id == map.origin()) part.keyframes.push_back(id);
  }
  return part;
}

Map side_by_side(std::span<const MapSnapshot* const> maps, const Vocabulary& vocabulary,
                 MergeSummary& summary) {
  std::vector<MapPart> parts;
  std::uint32_t first = 0;
  for (const MapSnapshot* const map : maps) {
    parts.push_back(whole(*map));
    const auto& keyframes = parts.back().keyframes;
    if (keyframes.empty()) throw InputError("one of the maps is empty");
    for (const KeyframeId id : keyframes) {
      if (map->at(id).observations->features.kind != vocabulary.kind()) {
        throw InputError("a map's descriptors are of another kind than the vocabulary's");
      }
    }
    summary.inputs.push_back({keyframes.size(), KeyframeId(first), {}});
    first += static_cast<std::uint32_t>(keyframes.size());
  }
  return assemble_map(parts);
}

class Merge {
 public:
  Merge(Map map, const Vocabulary& vocabulary, const MergeOptions& options, MergeSummary& summary,
        const std::function<bool()>& interrupted)
      : options_(options),
        backend_(options.backend, std::move(map)),
        places_(std::make_shared<KeyframeDatabase>(vocabulary)),
        summary_(summary),
        interrupted_(interrupted) {}

  // False if it was interrupted.
  bool run() {
    if (!find_places()) return false;
    join_components();
    if (summary_.joins == 0) return true;
    adjust();
    if (!close_loops()) return false;
    adjust();
    fuse();
    adjust();
    return true;
  }

  const Map& map() const { return backend_.map(); }

 private:
  const MapSnapshot& view() const { return backend_.view(); }
  bool stopped() const { return interrupted_ && interrupted_(); }

  // Between components: no gap of ids is large enough within one.
  bool find_places() {
    Stopwatch watch(summary_.find);
    LoopFinderOptions options = options_.finder;
    options.detector.min_gap = std::numeric_limits<int>::max();
    LoopFinder finder(places_, options);
    for (const KeyframeId id : view().keyframe_ids()) {
      if (stopped()) return false;
      for (LoopProposal& proposal : finder.find(view(), id)) {
        ++summary_.proposed;
        if (!proposal.verification.loop) continue;
        ++summary_.verified;
        found_.push_back(std::move(*proposal.verification.loop));
      }
    }
    return true;
  }

  bool apart(const LoopMeasurement& loop) const {
    return view().at(loop.keyframe).component != view().at(loop.match).component;
  }

  using Pair = std::pair<KeyframeId, KeyframeId>;
  Pair components_of(const LoopMeasurement& loop) const {
    return std::minmax<KeyframeId>(view().at(loop.keyframe).component,
                                   view().at(loop.match).component);
  }

  // The places that agree with one of them, at least one of which is evidence of its own.
  std::vector<std::size_t> agreeing_with(std::size_t first) const {
    std::vector<std::size_t> agreeing{first};
    bool evidence = false;
    const auto enough = static_cast<std::size_t>(options_.finder.verifier.min_final_matches);
    for (std::size_t i = 0; i < found_.size(); ++i) {
      if (i == first || !apart(found_[i])) continue;
      if (components_of(found_[i]) != components_of(found_[first])) continue;
      if (!places_agree(view(), found_[first], found_[i], options_.backend.loops)) continue;
      agreeing.push_back(i);
      evidence = evidence || landmarks_of_its_own(found_[i], found_[first]) >= enough;
    }
    return evidence ? agreeing : std::vector<std::size_t>();
  }

  // Those that most places speak for, one after the other.
  void join_components() {
    Stopwatch watch(summary_.close);
    for (;;) {
      std::vector<std::size_t> most;
      for (std::size_t i = 0; i < found_.size(); ++i) {
        if (!apart(found_[i])) continue;
        std::vector<std::size_t> agreeing = agreeing_with(i);
        if (agreeing.size() > most.size()) most = std::move(agreeing);
      }
      if (most.empty()) break;
      ++summary_.joins;
      for (const std::size_t i : most) close(found_[i]);
    }
    for (const LoopMeasurement& loop : found_) summary_.unconfirmed += apart(loop) ? 1 : 0;
  }

  void close(const LoopMeasurement& loop) {
    const std::size_t before = view().landmark_count();
    const LoopOutcome outcome = backend_.close(loop);
    summary_.fused += before - view().landmark_count();
    ++(outcome.end == LoopEnd::kClosed ? summary_.closed : summary_.refused);
    if (outcome.end != LoopEnd::kClosed) return;
    apply(fuse_places(view(), loop.keyframe, loop.match, options_.fusion));
  }

  void apply(const MapEdit& edit) {
    const std::size_t before = view().landmark_count();
    backend_.apply(edit);
    summary_.fused += before - view().landmark_count();
  }

  // Inside of what is one now.
  bool close_loops() {
    LoopFinder finder(places_, options_.finder);
    for (const KeyframeId id : view().keyframe_ids()) {
      if (stopped()) return false;
      std::vector<LoopProposal> proposals;
      {
        Stopwatch watch(summary_.find);
        proposals = finder.find(view(), id);
      }
      Stopwatch watch(summary_.close);
      for (LoopProposal& proposal : proposals) {
        if (proposal.verification.loop && !apart(*proposal.verification.loop)) {
          close(*proposal.verification.loop);
        }
      }
    }
    return true;
  }

  void fuse() {
    Stopwatch watch(summary_.fuse);
    for (const KeyframeId id : view().keyframe_ids()) {
      apply(fuse_with_neighbours(view(), id, options_.fusion));
    }
  }

  // Everything, with one keyframe of each component held.
  void adjust() {
    Stopwatch watch(summary_.adjust);
    ProblemConfig config = make_full_bundle(view(), options_.backend.full);
    for (const auto& [name, size] : component_sizes(view())) {
      if (std::erase(config.variable_poses, name) > 0) config.fixed_poses.push_back(name);
    }
    std::sort(config.fixed_poses.begin(), config.fixed_poses.end());
    backend_.take_in_full(solve_bundle(view(), config), backend_.closings());
  }

  MergeOptions options_;
  Backend backend_;
  std::shared_ptr<KeyframeDatabase> places_;
  MergeSummary& summary_;
  const std::function<bool()>& interrupted_;
  std::vector<LoopMeasurement> found_;
};

KeyframeId component_of_most(const MapSnapshot& map, const MergedInput& input) {
  std::map<KeyframeId, int> keyframes;
  for (std::uint32_t i = 0; i < input.keyframes; ++i) {
    ++keyframes[map.component(KeyframeId(input.first.value + i))];
  }
  return std::max_element(keyframes.begin(), keyframes.end(),
                          [](const auto& a, const auto& b) { return a.second < b.second; })
      ->first;
}

}  // namespace

MergeResult merge_maps(std::span<const MapSnapshot* const> maps, const Vocabulary& vocabulary,
                       const MergeOptions& options, const std::function<bool()>& interrupted) {
  MergeResult result;
  MergeSummary& summary = result.summary;
  Merge merge(side_by_side(maps, vocabulary, summary), vocabulary, options, summary, interrupted);
  result.interrupted = !merge.run();
  const MapSnapshot& view = merge.map().view();
  summary.components = component_sizes(view).size();
  for (MergedInput& input : summary.inputs) input.component = component_of_most(view, input);
  MapPart part;
  part.map = &view;
  part.keyframes = view.keyframe_ids();
  result.map = assemble_map({&part, 1});
  return result;
}

}  // namespace hybrid_slam
