#include "backend/problem/observation_chi2.h"

#include <limits>

#include "factors/camera_reprojection.h"

namespace hybrid_slam {

int residual_count(const FactorGraph& graph, const GraphObservation& observation) {
  const GraphCamera& camera = graph.cameras[graph.frames[observation.frame].camera];
  return reprojection_rows(camera.camera, observation.measurement);
}

double chi2(const FactorGraph& graph, const GraphObservation& observation) {
  const GraphFrame& frame = graph.frames[observation.frame];
  double residual[3] = {};
  const bool projects = camera_reprojection_residual(
      graph.cameras[frame.camera].camera, frame.cam_from_world.params.data(),
      graph.points[observation.point].in_world.data(), observation.measurement, observation.sigma,
      residual, nullptr, nullptr);
  if (!projects) return std::numeric_limits<double>::infinity();
  return residual[0] * residual[0] + residual[1] * residual[1] + residual[2] * residual[2];
}

std::vector<double> observations_chi2(const FactorGraph& graph) {
  std::vector<double> values;
  values.reserve(graph.observations.size());
  for (const GraphObservation& observation : graph.observations) {
    values.push_back(chi2(graph, observation));
  }
  return values;
}

}  // namespace hybrid_slam
