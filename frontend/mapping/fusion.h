#pragma once

#include <string>

#include "backend/map/map_edit.h"
#include "backend/map/map_snapshot.h"

namespace hybrid_slam {

struct FusionOptions {
  int neighbours = 10;        // covisible keyframes
  int second_neighbours = 5;  // and so many of each one's
  double radius = 3;          // [px] around the projection, growing with the scale
  double max_descriptor_distance = 0.6;
  double max_scale_ratio = 1.7;
  double chi2_mono = 5.991;
  double chi2_stereo = 7.815;

  std::string validate() const;
};

// Finds points that the map holds twice or has not yet linked: projects the keyframe's landmarks
// into its neighbours and theirs into it. Where the keypoint found has a landmark, the two are
// merged (the one with more observations stays); where it has none, it becomes an observation.
MapEdit fuse_with_neighbours(const MapSnapshot& map, KeyframeId keyframe,
                             const FusionOptions& options);

// The same where a loop joined two places: the landmarks around either keyframe are looked for in
// the keyframes around both.
MapEdit fuse_places(const MapSnapshot& map, KeyframeId a, KeyframeId b,
                    const FusionOptions& options);

}  // namespace hybrid_slam
