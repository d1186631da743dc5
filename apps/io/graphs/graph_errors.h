#pragma once

#include <map>
#include <optional>
#include <string>

#include "backend/problem/factor_graph.h"

namespace hybrid_slam {

// Squared distance between where a point projects and where it was measured [px^2], over the 2 or 3
// coordinates of the measurement; none if it does not project.
std::optional<double> squared_error(const FactorGraph& graph, const GraphObservation& observation);

struct ReprojectionError {
  std::size_t observations = 0;  // that project
  double rmse = 0;               // of their distances [px]
};

// By the name of the camera's model.
std::map<std::string, ReprojectionError> reprojection_errors(const FactorGraph& graph);

}  // namespace hybrid_slam
