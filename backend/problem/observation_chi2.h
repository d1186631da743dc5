#pragma once

#include <vector>

#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// Rows of the residual of an observation: 3 of a stereo measurement, else 2.
int residual_count(const FactorGraph& graph, const GraphObservation& observation);

// Squared whitened residual of an observation at the present estimate; infinite if its point does
// not project.
double chi2(const FactorGraph& graph, const GraphObservation& observation);

// Of each one.
std::vector<double> observations_chi2(const FactorGraph& graph);

}  // namespace hybrid_slam
