#pragma once

#include <string>
#include <vector>

#include "backend/map/map_edit.h"
#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

struct CullingOptions {
  double min_found_ratio = 0.25;  // found / visible of a recent landmark
  int min_observations = 3;      // of a landmark after `probation` keyframes; a stereo one counts 2
  int probation = 2;             // keyframes
  double redundant_share = 0.9;  // of a keyframe's landmarks seen elsewhere
  int redundant_observers = 3;   // by so many others, at the same or a finer scale
  double close_baselines = 40;   // stereo: only nearer landmarks count

  std::string validate() const;
};

// Watches landmarks through their first keyframes and names those that did not prove themselves.
class LandmarkProbation {
 public:
  explicit LandmarkProbation(const CullingOptions& options) : options_(options) {}

  // Called once per keyframe, right after it entered the map.
  MapEdit cull(const MapSnapshot& map, KeyframeId newest);

 private:
  struct Recent {
    LandmarkId id;
    int keyframes = 0;  // since it was born
  };

  void admit(const MapSnapshot& map, KeyframeId keyframe);

  CullingOptions options_;
  std::vector<Recent> recent_;
  KeyframeId previous_;
  LandmarkId newest_known_;
};

// Keyframes around `keyframe` that add little: nearly all their (close) landmarks are seen by
// enough others at the same or a finer scale. Never the origin, nor those to keep, nor `keyframe`
// itself.
MapEdit cull_keyframes(const MapSnapshot& map, KeyframeId keyframe, const CullingOptions& options);

}  // namespace hybrid_slam
