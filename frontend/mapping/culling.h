#pragma once

#include <string>
#include <vector>

#include "backend/map/map_edit.h"
#include "backend/map/map_snapshot.h"
#include "frontend/mapping/redundancy.h"

namespace hybrid_slam {

struct CullingOptions {
  double min_found_ratio = 0.25;  // found / visible of a recent landmark
  int min_observations = 3;  // of a landmark after `probation` keyframes; a stereo one counts 2
  int probation = 2;         // keyframes
  RedundancyOptions redundancy;
  double close_baselines = 40;  // stereo: only nearer landmarks count
  // So many of the newest keyframes, and those that share 15 landmarks with one of them, are in use
  // and keep features with neither a landmark nor a right match. 0: all keep them.
  int full_keyframes = 10;

  std::string validate() const;
};

// Watches landmarks through their first keyframes and names those that did not prove themselves.
class LandmarkProbation {
 public:
  explicit LandmarkProbation(const CullingOptions& options) : options_(options) {}

  // Called once per keyframe, right after it entered the map.
  MapEdit cull(const MapSnapshot& map, KeyframeId newest);

  // Called once, at the end, when no keyframe will judge the youngest any more. The same share is
  // asked of the frames since they were made: having been seen then proves nothing. Those that no
  // frame was to show since stay.
  MapEdit conclude(const MapSnapshot& map);

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

// Watches which keyframes go out of use. Mapping makes landmarks of features that have none where
// it looks, and that is in keyframes that share landmarks with the newest one.
class KeyframeUse {
 public:
  // Of a map that is gone on with, all count as being in use so far.
  KeyframeUse(const CullingOptions& options, const MapSnapshot& map)
      : options_(options), in_use_(map.keyframe_ids()) {}

  // Called once per keyframe, after all that it changes: which are no longer in use, ascending.
  std::vector<KeyframeId> gone_out(const MapSnapshot& map);

 private:
  CullingOptions options_;
  std::vector<KeyframeId> in_use_;  // ascending
};

// Keyframes around `keyframe` whose (close) landmarks make them redundant. Never the origin, nor
// those to keep, nor `keyframe` itself.
MapEdit cull_keyframes(const MapSnapshot& map, KeyframeId keyframe, const CullingOptions& options);

}  // namespace hybrid_slam
