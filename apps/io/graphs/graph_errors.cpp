#include "apps/io/graphs/graph_errors.h"

#include <cmath>

#include "apps/io/graphs/model_reprojection.h"

namespace hybrid_slam {

std::optional<double> squared_error(const FactorGraph& graph, const GraphObservation& observation) {
  const GraphFrame& frame = graph.frames[observation.frame];
  const Camera& camera = graph.cameras[frame.camera].camera;
  const Eigen::Vector3d point = frame.cam_from_world * graph.points[observation.point].in_world;
  const Eigen::Vector3d& measured = observation.measurement;
  if (std::holds_alternative<Calibrated<RectifiedStereo>>(camera) && !std::isnan(measured[2])) {
    const auto stereo = project_stereo(camera, point);
    if (!stereo) return std::nullopt;
    return (*stereo - measured).squaredNorm();
  }
  const auto pixel = project(camera, point);
  if (!pixel) return std::nullopt;
  return (*pixel - measured.head<2>()).squaredNorm();
}

std::map<std::string, ReprojectionError> reprojection_errors(const FactorGraph& graph) {
  std::map<std::string, ReprojectionError> errors;
  for (const GraphObservation& observation : graph.observations) {
    const Camera& camera = graph.cameras[graph.frames[observation.frame].camera].camera;
    ReprojectionError& error = errors[std::string(model_name(camera))];
    if (const auto squared = squared_error(graph, observation)) {
      ++error.observations;
      error.rmse += *squared;
    }
  }
  for (const GraphFactor& factor : graph.factors) {
    const auto* const named = dynamic_cast<const NamedReprojection*>(factor.function.get());
    if (named == nullptr) continue;
    const double* const variables[] = {
        graph.frames[factor.variables[0].index].cam_from_world.params.data(),
        graph.points[factor.variables[1].index].in_world.data(),
        graph.blocks[factor.variables[2].index].values.data()};
    ReprojectionError& error = errors[std::string(named->model_name())];
    Eigen::Vector2d residual;
    if (factor.function->Evaluate(variables, residual.data(), nullptr)) {
      ++error.observations;
      error.rmse += residual.squaredNorm();
    }
  }
  for (auto& [name, error] : errors) {
    if (error.observations > 0) {
      error.rmse = std::sqrt(error.rmse / static_cast<double>(error.observations));
    }
  }
  return errors;
}

}  // namespace hybrid_slam
