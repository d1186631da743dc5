#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "backend/backend.h"
#include "frontend/mapping/fusion.h"
#include "frontend/place_recognition/loop_finder.h"
#include "frontend/place_recognition/vocabulary.h"

namespace hybrid_slam {

struct MergeOptions {
  LoopFinderOptions finder;
  FusionOptions fusion;
  BackendOptions backend;
};

// A map that was merged into another one.
struct MergedInput {
  std::size_t keyframes = 0;
  KeyframeId first;      // the first of them in the merged map
  KeyframeId component;  // of most of them at the end
};

struct MergeStageTime {
  double wall_s = 0;
  double cpu_s = 0;
};

struct MergeSummary {
  std::vector<MergedInput> inputs;
  std::size_t components = 0;
  std::size_t proposed = 0;     // places between two components that the words proposed
  std::size_t verified = 0;     // of these, by geometry
  std::size_t joins = 0;        // of two components
  std::size_t unconfirmed = 0;  // places of components that stayed apart: no second one agreed
  std::size_t closed = 0;       // loops closed in all, those of the joins included
  std::size_t refused = 0;      // by the loop graph
  std::size_t fused = 0;        // landmarks that turned out to be others
  MergeStageTime find, close, fuse, adjust;
};

struct MergeResult {
  Map map;
  MergeSummary summary;
  bool interrupted = false;
};

// Joins maps of several dives. They are put side by side (map_assembly.h); every keyframe is looked
// for among those of the other components, words propose, geometry decides (loop_verifier.h). Two
// components are joined where two such places agree: each says where the one component lies against
// the other, and these differ by no more than the drift that the loop graph allows for the way
// between them (99 %); and the second shows enough landmarks for a place (min_final_matches) that
// the first does not, so that it is evidence of its own. All places that agree are closed as loops.
// Then loops are looked for again inside of what is now one component, landmarks that the dives
// have in common are fused, and everything is adjusted, with one keyframe of each component held.
//
// Components that nothing joins stay what they are. The world is that of the first map, or for a
// component without it that of its own map. Throws InputError, without a file's name, if there are
// descriptors of several kinds, or of another kind than the vocabulary's.
MergeResult merge_maps(std::span<const MapSnapshot* const> maps, const Vocabulary& vocabulary,
                       const MergeOptions& options, const std::function<bool()>& interrupted = {});

// For people, several lines. `names`: of the maps.
std::string to_text(const MergeSummary& summary, std::span<const std::string> names);
nlohmann::ordered_json to_json(const MergeSummary& summary, std::span<const std::string> names);

}  // namespace hybrid_slam
