#pragma once

#include <cstddef>

#include "backend/map/map_snapshot.h"
#include "test/support/filled_map.h"

namespace hybrid_slam {

// How far a solution lies from the truth, in units of what the noise explains.
struct TruthCheck {
  // e^T S e over the poses' degrees of freedom, where e is the error of the free poses and S their
  // information at the truth, landmarks marginalised. Expectation 1, standard deviation
  // sqrt(2 / freedom), if the solution is the least squares one.
  double nees = 0;
  std::size_t freedom = 0;
  // The squared residuals over (number of residuals - number of unknowns); expectation 1.
  double variance = 0;
  double residual_freedom = 0;
  double worst_translation = 0;  // of a pose [m]
};

// Compares the keyframes after the first `fixed` ones (those must be at the truth) and all
// landmarks with the scene, using the observations that are in the map and no wrong matches.
TruthCheck check_truth(const SyntheticScene& scene, const FilledMap& filled, std::size_t fixed = 1);

// Wrong matches in the map, of landmarks with at least so many observations (two that disagree do
// not tell which is wrong).
std::size_t count_wrong(const SyntheticScene& scene, const FilledMap& filled,
                        std::size_t min_observations);

std::size_t count_observations(const MapSnapshot& map);

}  // namespace hybrid_slam
