#pragma once

#include <string>
#include <vector>

#include "backend/map/map_snapshot.h"
#include "backend/problem/loop_graph.h"
#include "backend/problem/problem_config.h"

namespace hybrid_slam {

struct LoopClosureOptions {
  LoopGraphOptions graph;
  // A loop is taken if the map can be bent to it at a price (chi2 of the loop graph at its optimum,
  // which is how far the loop lies from where the map expects it, squared and in standard
  // deviations) that a true one exceeds in 1 % of all cases: 2.326 standard deviations of a normal
  // distribution.
  double gate = 2.326;
  double chi2_loop = 16.812;  // 99 %, 6 degrees of freedom: of one loop among several

  std::string validate() const;
};

// What closing a loop does to a map.
struct LoopClosure {
  std::vector<std::size_t> taken;  // indices of the loops that were taken, ascending; or none
  BundleResult correction;         // of all poses and landmarks; empty if none was taken
  double chi2 = 0;                 // what the map was bent by, or would have had to be
};

// Closes loops.back(), the newest one, if the map can be bent to it at a plausible price. If not, a
// robust loss decides which of `loops`, earlier ones that were not taken, agree with it: together
// they are believed where one alone is not. A false loop is refused and bends nothing. `closed`:
// what was closed before. Loops whose keyframes have gone are never taken.
LoopClosure close_loop(const MapSnapshot& map, const std::vector<PoseConstraint>& loops,
                       const std::vector<LoopEnds>& closed, const LoopClosureOptions& options);

}  // namespace hybrid_slam
