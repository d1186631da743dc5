#pragma once

#include <memory>
#include <vector>

#include "backend/problem/factor_graph.h"
#include "backend/problem/problem_config.h"

namespace ceres {
class CostFunction;
class Problem;
}  // namespace ceres

namespace hybrid_slam {

// The terms of a graph but its observations as functions that Ceres can evaluate, one for each
// element of the graph's vectors of the same names. They hold the measurements but not the
// estimate.
struct GraphFactors {
  GraphFactors();
  GraphFactors(GraphFactors&&) noexcept;
  GraphFactors& operator=(GraphFactors&&) noexcept;
  ~GraphFactors();

  std::vector<std::unique_ptr<ceres::CostFunction>> edges;
  std::vector<std::unique_ptr<ceres::CostFunction>> priors;
  std::vector<std::unique_ptr<ceres::CostFunction>> similarity_edges;
  std::vector<std::shared_ptr<const ceres::CostFunction>> factors;  // with left Jacobians
  std::vector<char> active;                                         // per observation; 0: set aside
  std::vector<char> factor_active;                                  // per factor of any kind
};

// Requires a valid graph. All observations are active.
GraphFactors make_factors(const FactorGraph& graph);

// Squared residuals of the factors of any kind, at the present estimate; infinite where a function
// fails.
std::vector<double> factors_chi2(const FactorGraph& graph, const GraphFactors& factors);

// Of all edges of both kinds and all priors together.
double edges_chi2(const FactorGraph& graph, const GraphFactors& factors);

// A graph as Ceres solves it: on the values of the graph, but for frames that have a refined camera
// for themselves, which are joint blocks (backend/problem/joint_frame.h) kept here.
struct CeresGraph {
  CeresGraph();
  CeresGraph(CeresGraph&&) noexcept;
  ~CeresGraph();

  std::vector<std::vector<double>> joint_frames;  // as graph.frames; empty where separate
  std::vector<std::unique_ptr<ceres::CostFunction>> observations;  // active ones
  std::vector<std::unique_ptr<ceres::CostFunction>> joint_factors;
  std::unique_ptr<ceres::Problem> problem;

  // Joint blocks into the graph.
  void write_back(FactorGraph& graph) const;
};

// The active terms as a Ceres problem on the estimate of `graph`; both must outlive it. What is not
// in a term that varies is not in it.
CeresGraph build_ceres_problem(FactorGraph& graph, const GraphFactors& factors,
                               const ProblemOptions& options, Loss observation_loss);

// The parameter block of a camera's params.
double* params_of(Camera& camera);

}  // namespace hybrid_slam
