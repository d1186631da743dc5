#include "backend/problem/factor_graph.h"

#include <cmath>
#include <type_traits>
#include <variant>

#include "backend/problem/measurement_fault.h"
#include "factors/whitening.h"

namespace hybrid_slam {

namespace {

constexpr const char* kNoFrame = "no such frame";

std::string fault(const char* what, std::size_t index, const char* reason) {
  return std::string(what) + " " + std::to_string(index) + ": " + reason;
}

bool is_stereo(const Camera& camera) {
  return std::holds_alternative<Calibrated<RectifiedStereo>>(camera);
}

// Null if all is well.
const char* fault_of(const FactorGraph& graph, const GraphObservation& observation) {
  if (observation.frame >= graph.frames.size()) return kNoFrame;
  if (observation.point >= graph.points.size()) return "no such point";
  const std::uint32_t camera = graph.frames[observation.frame].camera;
  if (camera >= graph.cameras.size()) return "its frame has no camera";
  return measurement_fault(observation, graph.cameras[camera].camera);
}

// An edge of either kind.
template <typename Edge>
const char* edge_fault(const Edge& edge) {
  if (edge.a == edge.b) return "joins a frame to itself";
  if (!edge.a_from_b.params.allFinite()) return "measurement is not finite";
  return information_fault(edge.information);
}

const char* fault_of(const FactorGraph& graph, const GraphEdge& edge) {
  const std::size_t count = graph.frames.size();
  return edge.a >= count || edge.b >= count ? kNoFrame : edge_fault(edge);
}

const char* fault_of(const FactorGraph& graph, const GraphPrior& prior) {
  for (const std::uint32_t frame : prior.frames) {
    if (frame >= graph.frames.size()) return "no such frame";
  }
  for (const std::uint32_t block : prior.blocks) {
    if (block >= graph.blocks.size()) return "no such block";
  }
  auto columns = static_cast<Eigen::Index>(6 * prior.frames.size());
  for (const PriorBlock& base : prior.block_bases) columns += base.tangent_size();
  if (prior.bases.size() != prior.frames.size() ||
      prior.block_bases.size() != prior.blocks.size() || prior.jacobian.cols() != columns ||
      prior.jacobian.rows() != prior.residual.size() || prior.residual.size() == 0) {
    return "sizes do not agree";
  }
  if (!prior.jacobian.allFinite() || !prior.residual.allFinite()) return "values are not finite";
  return nullptr;
}

const char* fault_of(const FactorGraph& graph, const GraphSimilarityEdge& edge) {
  const std::size_t count = graph.similarities.size();
  if (edge.a >= count || edge.b >= count) return kNoFrame;
  const char* fault = edge_fault(edge);
  return fault == nullptr && !(edge.a_from_b.scale() > 0) ? "scale must be positive" : fault;
}

const char* fault_of(const FactorGraph&, const GraphSimilarity& similarity) {
  if (!similarity.cam_from_world.params.allFinite()) return "pose is not finite";
  return similarity.cam_from_world.scale() > 0 ? nullptr : "scale must be positive";
}

const char* fault_of(const FactorGraph& graph, const GraphFrame& frame) {
  if (!frame.cam_from_world.params.allFinite()) return "pose is not finite";
  if (frame.camera != GraphFrame::kNoCamera && frame.camera >= graph.cameras.size()) {
    return "no such camera";
  }
  return nullptr;
}

const char* fault_of(const FactorGraph&, const GraphCamera& camera) {
  const bool finite = std::visit(
      [](const auto& c) {
        for (const double value : c.params) {
          if (!std::isfinite(value)) return false;
        }
        return true;
      },
      camera.camera);
  return finite ? nullptr : "parameters are not finite";
}

const char* fault_of(const FactorGraph&, const GraphPoint& point) {
  return point.in_world.allFinite() ? nullptr : "position is not finite";
}

std::string block_faults(const FactorGraph& graph) {
  for (std::size_t i = 0; i < graph.blocks.size(); ++i) {
    std::string reason = block_fault(graph.blocks[i]);
    const std::uint32_t frame = graph.blocks[i].rides_with;
    if (reason.empty() && frame != GraphBlock::kNone && frame >= graph.frames.size()) {
      reason = kNoFrame;
    }
    if (!reason.empty()) return fault("block", i, reason.c_str());
  }
  return {};
}

std::string factor_faults(const FactorGraph& graph) {
  constexpr const char* kAbsent = "is not there";
  const auto size_of = [&](const GraphVariable& variable) -> VariableSize {
    const std::size_t i = variable.index;
    if (variable.kind == GraphVariable::Kind::kPose) {
      return i < graph.frames.size() ? VariableSize{7, nullptr} : VariableSize{0, kAbsent};
    }
    if (variable.kind == GraphVariable::Kind::kPoint) {
      return i < graph.points.size() ? VariableSize{3, nullptr} : VariableSize{0, kAbsent};
    }
    if (i >= graph.blocks.size()) return {0, kAbsent};
    return {static_cast<int>(graph.blocks[i].values.size()), nullptr};
  };
  for (std::size_t i = 0; i < graph.factors.size(); ++i) {
    const std::string reason = factor_fault(graph.factors[i], size_of);
    if (!reason.empty()) return fault("factor", i, reason.c_str());
  }
  return {};
}

template <typename T>
std::string first_fault(const FactorGraph& graph, const std::vector<T>& items, const char* what) {
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (const char* reason = fault_of(graph, items[i])) return fault(what, i, reason);
  }
  return {};
}

}  // namespace

const char* measurement_fault(const GraphObservation& observation, const Camera& camera) {
  if (!observation.measurement.head<2>().allFinite()) return "measurement is not finite";
  if (is_stereo(camera) && std::isinf(observation.measurement[2])) {
    return "measurement is not finite";
  }
  if (!(observation.sigma > 0) || !std::isfinite(observation.sigma)) {
    return "sigma must be positive and finite";
  }
  return nullptr;
}

const char* measurement_fault(const GraphEdge& edge) { return edge_fault(edge); }

std::string FactorGraph::validate() const {
  std::string wrong = first_fault(*this, cameras, "camera");
  if (wrong.empty()) wrong = first_fault(*this, frames, "frame");
  if (wrong.empty()) wrong = first_fault(*this, points, "point");
  if (wrong.empty()) wrong = first_fault(*this, observations, "observation");
  if (wrong.empty()) wrong = first_fault(*this, edges, "edge");
  if (wrong.empty()) wrong = first_fault(*this, priors, "prior");
  if (wrong.empty()) wrong = first_fault(*this, similarities, "similarity");
  if (wrong.empty()) wrong = first_fault(*this, similarity_edges, "similarity edge");
  if (wrong.empty()) wrong = block_faults(*this);
  if (wrong.empty()) wrong = factor_faults(*this);
  return wrong;
}

}  // namespace hybrid_slam
