#include <ceres/cost_function.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "backend/incremental/incremental_solver.h"
#include "backend/problem/measurement_fault.h"
#include "factors/relative_pose_factor.h"

// What is added to the graph of an IncrementalSolver, and what is taken out.

namespace hybrid_slam {

namespace {

template <typename T>
T& item(std::vector<T>& items, std::uint32_t index, const char* what) {
  if (index >= items.size())
    throw std::logic_error(std::string("IncrementalSolver: no such ") + what);
  return items[index];
}

// Throws if there is a fault.
void refuse(const char* fault, const char* what) {
  if (fault == nullptr) return;
  throw std::logic_error("IncrementalSolver: " + std::string(what) + ": " + fault);
}

// What is left empty holds no memory: keyframes that went for good stay as empty poses.
void erase_value(std::vector<std::uint32_t>& values, std::uint32_t value) {
  values.erase(std::remove(values.begin(), values.end(), value), values.end());
  if (values.empty()) values.shrink_to_fit();
}

}  // namespace

std::uint32_t IncrementalSolver::add_camera(const Camera& camera) {
  cameras_.push_back(camera);
  return static_cast<std::uint32_t>(cameras_.size()) - 1;
}

std::uint32_t IncrementalSolver::add_pose(const GraphFrame& frame) {
  refuse(frame.cam_from_world.params.allFinite() ? nullptr : "not finite", "pose");
  const std::uint32_t index = frame.fixed ? new_pose(true) : free_pose();
  Pose& pose = poses_[index];
  pose.tangent.place = inverse(frame.cam_from_world).translation();
  pose.folded = frame.cam_from_world;
  pose.folded_delta.setZero();
  pose.camera = frame.camera;
  if (!frame.fixed) newest_.push_back(pose.variable);
  return index;
}

std::uint32_t IncrementalSolver::new_pose(bool fixed) {
  const auto index = static_cast<std::uint32_t>(poses_.size());
  poses_.emplace_back();
  poses_.back().variable = add_variable(false, index, fixed);
  tree_.resize(variables_.size());
  return index;
}

// One that was removed, or a new one. Indices tell which poses are new (condense_old()), so that of
// an old one stays unused.
std::uint32_t IncrementalSolver::free_pose() {
  const auto keep = static_cast<std::size_t>(options_.condense_after);
  std::erase_if(free_poses_, [&](std::uint32_t pose) { return pose + keep < poses_.size(); });
  if (free_poses_.empty()) return new_pose(false);
  const std::uint32_t index = free_poses_.back();
  free_poses_.pop_back();
  return index;
}

bool IncrementalSolver::remove_pose(std::uint32_t index) {
  Pose& pose = item(poses_, index, "pose");
  Variable& variable = variables_[pose.variable];
  const bool is_used =
      variable.fixed || !variable.terms.empty() || !variable.mixed.empty() ||
      std::find(free_poses_.begin(), free_poses_.end(), index) != free_poses_.end() ||
      std::find(touched_.begin(), touched_.end(), pose.variable) != touched_.end() ||
      std::any_of(blocks_.begin(), blocks_.end(), [&](const Block& block) {
        return block.there && block.carrier == pose.variable;
      });
  if (is_used || options_.window > 0 || !tree_.renew(pose.variable)) return false;
  variable.damping = 0;
  free_poses_.push_back(index);
  return true;
}

std::uint32_t IncrementalSolver::add_variable(bool is_block, std::uint32_t index, bool fixed) {
  Variable variable;
  variable.is_block = is_block;
  variable.index = index;
  variable.fixed = fixed;
  variables_.push_back(std::move(variable));
  return static_cast<std::uint32_t>(variables_.size()) - 1;
}

// Notes with a variable that a term has it; the term's own variables are up to date.
void IncrementalSolver::link(std::uint32_t index, std::uint32_t term) {
  Variable& variable = variables_[index];
  if (variable.gone) return;
  const auto others = poses_of(term);
  const bool mixed = variable.shared &&
                     std::any_of(others.begin(), others.end(),
                                 [this](std::uint32_t other) { return !variables_[other].shared; });
  (variable.fixed ? variable.dormant : mixed ? variable.mixed : variable.terms).push_back(term);
}

void IncrementalSolver::unlink(std::uint32_t index, std::uint32_t term) {
  Variable& variable = variables_[index];
  erase_value(variable.terms, term);
  if (variable.shared) erase_value(variable.mixed, term);
  if (variable.fixed || !variable.dormant.empty()) erase_value(variable.dormant, term);
}

std::uint32_t IncrementalSolver::add_point(const Eigen::Vector3d& in_world) {
  refuse(in_world.allFinite() ? nullptr : "not finite", "point");
  LandmarkTerm landmark;
  landmark.base = in_world;
  if (!free_points_.empty()) {
    const std::uint32_t index = free_points_.back();
    free_points_.pop_back();
    landmarks_[index] = std::make_unique<LandmarkTerm>(std::move(landmark));
    point_there_[index] = 1;
    live_points_.push_back(index);
    return index;
  }
  const auto made = static_cast<std::uint32_t>(landmarks_.size());
  landmarks_.push_back(std::make_unique<LandmarkTerm>(std::move(landmark)));
  point_there_.push_back(1);
  condensed_in_.push_back(kNone);
  live_points_.push_back(made);
  landmark_terms_.push_back(add_term(TermKind::kLandmark, made));
  return made;
}

std::uint32_t IncrementalSolver::add_term(TermKind kind, std::uint32_t index) {
  Term term;
  term.kind = kind;
  term.index = index;
  if (!free_terms_.empty()) {
    const std::uint32_t id = free_terms_.back();
    free_terms_.pop_back();
    term.step = terms_[id].step;
    terms_[id] = term;
    return id;
  }
  terms_.push_back(term);
  return static_cast<std::uint32_t>(terms_.size()) - 1;
}

std::uint32_t IncrementalSolver::add_observation(const GraphObservation& observation) {
  Pose& pose = item(poses_, observation.frame, "pose");
  item(landmarks_, observation.point, "point");
  refuse(point_there_[observation.point] != 0 ? nullptr : "was removed", "point");
  const Camera& camera = item(cameras_, pose.camera, "camera");
  refuse(measurement_fault(observation, camera), "observation");
  const std::uint32_t index = free_observation();
  observations_[index] = {observation.frame, observation.point,
                          observation.measurement.cast<float>(),
                          static_cast<float>(observation.sigma)};
  observation_there_[index] = 1;
  LandmarkTerm& landmark = live(observation.point);
  LandmarkView view;
  view.observation = index;
  view.pose = pose.variable;
  view.fixed = variables_[pose.variable].fixed;
  const bool is_first = !uses(landmark, pose.variable);
  landmark.views.push_back(view);
  if (is_first) {
    if (!view.fixed) landmark.poses.push_back(pose.variable);
    link(pose.variable, landmark_terms_[observation.point]);
  }
  mark_dirty(landmark_terms_[observation.point]);
  return index;
}

std::uint32_t IncrementalSolver::free_observation() {
  if (!free_observations_.empty()) {
    const std::uint32_t index = free_observations_.back();
    free_observations_.pop_back();
    return index;
  }
  observations_.emplace_back();
  observation_there_.push_back(0);
  return static_cast<std::uint32_t>(observations_.size()) - 1;
}

std::uint32_t IncrementalSolver::add_edge(const GraphEdge& edge) {
  item(poses_, edge.a, "pose");
  item(poses_, edge.b, "pose");
  refuse(measurement_fault(edge), "edge");
  const std::uint32_t index = free_edge();
  edges_[index] = edge;
  edge_there_[index] = 1;
  edge_factors_[index] = std::make_unique<RelativePoseFactor>(edge.a_from_b, edge.information);
  EdgeTerm term;
  for (const std::uint32_t pose : {edge.a, edge.b}) {
    const std::uint32_t variable = poses_[pose].variable;
    if (!variables_[variable].fixed) term.poses[term.variable++] = variable;
  }
  edge_terms_[index] = term;
  const std::uint32_t id = edge_ids_[index];
  for (const std::uint32_t pose : {edge.a, edge.b}) link(poses_[pose].variable, id);
  mark_dirty(id);
  return index;
}

std::uint32_t IncrementalSolver::free_edge() {
  if (!free_edges_.empty()) {
    const std::uint32_t index = free_edges_.back();
    free_edges_.pop_back();
    return index;
  }
  const auto made = static_cast<std::uint32_t>(edges_.size());
  edges_.emplace_back();
  edge_there_.push_back(0);
  edge_factors_.emplace_back();
  edge_terms_.emplace_back();
  edge_ids_.push_back(add_term(TermKind::kEdge, made));
  return made;
}

void IncrementalSolver::remove_observation(std::uint32_t observation) {
  if (item(observation_there_, observation, "observation") == 0) return;
  const Seen& removed = observations_[observation];
  LandmarkTerm& landmark = live(removed.point);
  observation_there_[observation] = 0;
  const std::uint32_t term = landmark_terms_[removed.point];
  mark_dirty(term);  // before: its former poses are touched too
  free_observations_.push_back(observation);
  std::erase_if(landmark.views,
                [&](const LandmarkView& view) { return view.observation == observation; });
  const std::uint32_t variable = poses_[removed.frame].variable;
  if (uses(landmark, variable)) return;
  touched_.push_back(variable);
  erase_value(landmark.poses, variable);
  unlink(variable, term);
}

void IncrementalSolver::remove_point(std::uint32_t point) {
  item(landmarks_, point, "point");
  if (point_there_[point] == 0) return;
  const LandmarkTerm& landmark = live(point);
  point_there_[point] = 0;
  while (!landmark.views.empty()) remove_observation(landmark.views.back().observation);
  while (!landmark.factors.empty()) remove_factor(landmark.factors.back().factor);
  free_points_.push_back(point);
}

void IncrementalSolver::remove_edge(std::uint32_t edge) {
  if (item(edge_there_, edge, "edge") == 0) return;
  edge_there_[edge] = 0;
  mark_dirty(edge_ids_[edge]);
  for (const std::uint32_t pose : {edges_[edge].a, edges_[edge].b}) {
    touched_.push_back(poses_[pose].variable);
    unlink(poses_[pose].variable, edge_ids_[edge]);
  }
  edge_terms_[edge].variable = 0;
  free_edges_.push_back(edge);
}

}  // namespace hybrid_slam
