#pragma once

#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

struct LawnMowerOptions {
  int keyframes = 500;
  int per_track = 50;                      // keyframes from one turn to the next
  double observations_per_keyframe = 300;  // on average
  double step = 0.8;                       // between keyframes [m]: landmarks are seen four times
  double spacing = 3.4;  // of tracks [m]: a fifth of the view is seen from the next
};

// A stereo pair surveys the ground 3 m below it, up and down in tracks that overlap, and so sees
// part of each track's ground again a track later. From disturbed starts.
FactorGraph lawn_mower_graph(const LawnMowerOptions& options);

}  // namespace hybrid_slam
