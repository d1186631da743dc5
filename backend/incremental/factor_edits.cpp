#include <ceres/cost_function.h>
#include <ceres/manifold.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "backend/incremental/incremental_solver.h"
#include "factors/left_jacobian.h"

// Blocks, and factors of any kind, in the graph of an IncrementalSolver; what varies and what not.

namespace hybrid_slam {

namespace {

[[noreturn]] void refuse_because(const char* what, std::size_t index, const std::string& fault) {
  throw std::logic_error("IncrementalSolver: " + std::string(what) + " " + std::to_string(index) +
                         ": " + fault);
}

bool contains(const std::vector<std::uint32_t>& values, std::uint32_t value) {
  return std::find(values.begin(), values.end(), value) != values.end();
}

void add_once(std::vector<std::uint32_t>& values, std::uint32_t value) {
  if (!contains(values, value)) values.push_back(value);
}

}  // namespace

VariableSize IncrementalSolver::size_of(const GraphVariable& variable) const {
  switch (variable.kind) {
    case GraphVariable::Kind::kPose:
      return variable.index < poses_.size() ? VariableSize{7, nullptr}
                                            : VariableSize{0, "is not there"};
    case GraphVariable::Kind::kPoint:
      if (variable.index >= landmarks_.size()) return {0, "is not there"};
      return point_there_[variable.index] != 0 ? VariableSize{3, nullptr}
                                               : VariableSize{0, "was removed"};
    case GraphVariable::Kind::kBlock:
      break;
  }
  if (variable.index >= blocks_.size()) return {0, "is not there"};
  const Block& block = blocks_[variable.index];
  return block.there ? VariableSize{static_cast<int>(block.inner.size()), nullptr}
                     : VariableSize{0, "was removed"};
}

// Of a pose or a block.
std::uint32_t IncrementalSolver::variable_of(const GraphVariable& variable) const {
  const VariableSize found = size_of(variable);
  if (found.fault != nullptr) refuse_because("variable", variable.index, found.fault);
  if (variable.kind == GraphVariable::Kind::kPoint) {
    refuse_because("variable", variable.index, "is a point: those are eliminated in their terms");
  }
  return variable.kind == GraphVariable::Kind::kPose ? poses_[variable.index].variable
                                                     : blocks_[variable.index].variable;
}

std::uint32_t IncrementalSolver::add_block(const GraphBlock& given) {
  const std::size_t next = free_blocks_.empty() ? blocks_.size() : free_blocks_.back();
  if (const std::string fault = block_fault(given); !fault.empty()) {
    refuse_because("block", next, fault);
  }
  if (given.rides_with != GraphBlock::kNone && given.rides_with >= poses_.size()) {
    refuse_because("block", next,
                   "rides with pose " + std::to_string(given.rides_with) + ", which is not there");
  }
  const auto index = static_cast<std::uint32_t>(next);
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  if (given.rides_with != GraphBlock::kNone) {
    rotation = pose(given.rides_with).rotation().toRotationMatrix();
  }
  Block block(given, rotation);
  block.variable = add_variable(true, index, given.fixed);
  variables_.back().shared = given.shared;
  if (given.rides_with != GraphBlock::kNone) block.carrier = poses_[given.rides_with].variable;
  tree_.add(static_cast<std::size_t>(block.tangent_size()), given.shared);
  if (!given.fixed && !given.shared) newest_.push_back(block.variable);
  if (index < blocks_.size()) {
    free_blocks_.pop_back();
    blocks_[index] = std::move(block);
  } else {
    blocks_.push_back(std::move(block));
  }
  return index;
}

// Varying or not, without the point: with the poses whose turns move what rides with them.
std::vector<std::uint32_t> IncrementalSolver::all_variables(const Factor& factor) const {
  std::vector<std::uint32_t> all;
  for (const GraphVariable& variable : factor.given.variables) {
    if (variable.kind == GraphVariable::Kind::kPose) add_once(all, poses_[variable.index].variable);
    if (variable.kind != GraphVariable::Kind::kBlock) continue;
    const Block& block = blocks_[variable.index];
    add_once(all, block.variable);
    if (!block.given.world_vectors.empty() && !variables_[block.variable].fixed) {
      add_once(all, block.carrier);
    }
  }
  return all;
}

std::vector<std::uint32_t> IncrementalSolver::all_variables(const LandmarkTerm& landmark) const {
  std::vector<std::uint32_t> all;
  for (const LandmarkView& view : landmark.views) add_once(all, view.pose);
  for (const FactorView& view : landmark.factors) {
    for (const std::uint32_t v : all_variables(factors_[view.factor])) add_once(all, v);
  }
  return all;
}

std::vector<std::uint32_t> IncrementalSolver::all_variables_of_term(std::uint32_t id) const {
  const Term& term = terms_[id];
  switch (term.kind) {
    case TermKind::kEdge:
      return {poses_[edges_[term.index].a].variable, poses_[edges_[term.index].b].variable};
    case TermKind::kPrior:
      return priors_[term.index].all.variables;
    case TermKind::kFactor:
      return all_variables(factors_[term.index]);
    case TermKind::kCondensed: {
      std::vector<std::uint32_t> all;
      for (const std::uint32_t observation : condensed_[term.index].observations) {
        add_once(all, poses_[observations_[observation].frame].variable);
      }
      return all;
    }
    case TermKind::kLandmark:
      break;
  }
  return all_variables(*landmarks_[term.index]);
}

bool IncrementalSolver::uses(const LandmarkTerm& landmark, std::uint32_t variable) const {
  return std::any_of(landmark.views.begin(), landmark.views.end(),
                     [&](const LandmarkView& view) { return view.pose == variable; }) ||
         std::any_of(landmark.factors.begin(), landmark.factors.end(), [&](const FactorView& view) {
           return contains(all_variables(factors_[view.factor]), variable);
         });
}

// Those that vary, and where the columns of each begin.
void IncrementalSolver::place_columns(const std::vector<std::uint32_t>& all,
                                      std::vector<std::uint32_t>& variables,
                                      std::vector<Eigen::Index>& offsets) const {
  variables.clear();
  offsets.assign(1, 0);
  for (const std::uint32_t v : all) {
    if (variables_[v].fixed) continue;
    variables.push_back(v);
    offsets.push_back(offsets.back() + tree_.size(v));
  }
}

std::uint32_t IncrementalSolver::add_factor(const GraphFactor& given) {
  const std::size_t next = free_factors_.empty() ? factors_.size() : free_factors_.back();
  const std::string fault =
      factor_fault(given, [this](const GraphVariable& variable) { return size_of(variable); });
  if (!fault.empty()) refuse_because("factor", next, fault);
  Factor factor;
  factor.given = given;
  factor.there = true;
  std::vector<char> is_pose;
  for (const GraphVariable& variable : given.variables) {
    is_pose.push_back(variable.kind == GraphVariable::Kind::kPose ? 1 : 0);
    if (variable.kind == GraphVariable::Kind::kPoint) factor.point = variable.index;
  }
  factor.function = left_jacobian(given.function, is_pose);
  Eigen::VectorXd residual(given.function->num_residuals());
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  if (factor.point != kNone) at = point(factor.point);
  if (!factor_residual(factor, &at, residual) && !residual.allFinite()) {
    refuse_because("factor", next, "its residual is not a number at the present estimate");
  }
  const auto index = static_cast<std::uint32_t>(next);
  if (index < factors_.size()) {
    free_factors_.pop_back();
    factor.term = factors_[index].term;
    factors_[index] = std::move(factor);
  } else {
    factors_.push_back(std::move(factor));
    factor_terms_.emplace_back();
  }
  if (factors_[index].point != kNone) {
    join_landmark(index);
    return index;
  }
  RowsTerm& rows = factor_terms_[index];
  const std::vector<std::uint32_t> all = all_variables(factors_[index]);
  place_columns(all, rows.variables, rows.offsets);
  if (factors_[index].term == kNone) factors_[index].term = add_term(TermKind::kFactor, index);
  for (const std::uint32_t v : all) link(v, factors_[index].term);
  mark_dirty(factors_[index].term);
  return index;
}

// A factor over a point becomes part of the landmark's term.
void IncrementalSolver::join_landmark(std::uint32_t index) {
  const Factor& factor = factors_[index];
  LandmarkTerm& landmark = live(factor.point);
  const std::uint32_t term = landmark_terms_[factor.point];
  const std::vector<std::uint32_t> all = all_variables(factor);
  std::vector<std::uint32_t> first;
  for (const std::uint32_t v : all) {
    if (!uses(landmark, v)) first.push_back(v);
  }
  FactorView view;
  view.factor = index;
  place_columns(all, view.variables, view.offsets);
  landmark.factors.push_back(std::move(view));
  for (const std::uint32_t v : first) {
    if (!variables_[v].fixed) landmark.poses.push_back(v);
  }
  for (const std::uint32_t v : first) link(v, term);
  mark_dirty(term);
}

void IncrementalSolver::leave_landmark(std::uint32_t index) {
  const Factor& factor = factors_[index];
  LandmarkTerm& landmark = live(factor.point);
  const std::uint32_t term = landmark_terms_[factor.point];
  mark_dirty(term);
  const std::vector<std::uint32_t> all = all_variables(factor);
  std::erase_if(landmark.factors, [&](const FactorView& view) { return view.factor == index; });
  for (const std::uint32_t v : all) {
    if (uses(landmark, v)) continue;
    touched_.push_back(v);
    std::erase(landmark.poses, v);
    unlink(v, term);
  }
}

void IncrementalSolver::remove_factor(std::uint32_t index) {
  if (index >= factors_.size()) refuse_because("factor", index, "is not there");
  Factor& factor = factors_[index];
  if (!factor.there) return;
  if (factor.point != kNone) {
    leave_landmark(index);
  } else {
    mark_dirty(factor.term);
    for (const std::uint32_t v : all_variables(factor)) {
      touched_.push_back(v);
      unlink(v, factor.term);
    }
    factor_terms_[index] = {};
  }
  factor.there = false;
  factor.function.reset();
  factor.given = {};
  free_factors_.push_back(index);
}

void IncrementalSolver::remove_block(std::uint32_t index) {
  if (index >= blocks_.size()) refuse_because("block", index, "is not there");
  if (!blocks_[index].there) return;
  for (std::uint32_t i = 0; i < factors_.size(); ++i) {
    if (!factors_[i].there) continue;
    const auto& variables = factors_[i].given.variables;
    if (std::find(variables.begin(), variables.end(), block_variable(index)) != variables.end()) {
      remove_factor(i);
    }
  }
  Block& block = blocks_[index];
  const std::uint32_t variable = block.variable;
  // What priors say about others is what they say with the block where it is.
  set_fixed(block_variable(index), true);
  variables_[variable].gone = true;
  variables_[variable].dormant.clear();
  block.there = false;
  free_blocks_.push_back(index);
}

// Brings a term's variables in line with what is fixed.
void IncrementalSolver::refresh(std::uint32_t id) {
  const Term& term = terms_[id];
  const auto before = poses_of(id);
  touched_.insert(touched_.end(), before.begin(), before.end());
  const std::vector<std::uint32_t> all = all_variables_of_term(id);
  for (const std::uint32_t v : all) unlink(v, id);
  if (term.kind == TermKind::kEdge) {
    EdgeTerm& edge = edge_terms_[term.index];
    edge.variable = 0;
    for (const std::uint32_t v : all) {
      if (!variables_[v].fixed) edge.poses[edge.variable++] = v;
    }
  } else if (term.kind == TermKind::kFactor) {
    RowsTerm& rows = factor_terms_[term.index];
    place_columns(all, rows.variables, rows.offsets);
  } else if (term.kind == TermKind::kPrior) {
    put_fixed_in(priors_[term.index]);
  } else {
    LandmarkTerm& landmark = *landmarks_[term.index];
    std::erase_if(landmark.poses,
                  [&](std::uint32_t v) { return variables_[v].fixed || !contains(all, v); });
    for (const std::uint32_t v : all) {
      if (!variables_[v].fixed) add_once(landmark.poses, v);
    }
    for (LandmarkView& view : landmark.views) view.fixed = variables_[view.pose].fixed;
    for (FactorView& view : landmark.factors) {
      place_columns(all_variables(factors_[view.factor]), view.variables, view.offsets);
    }
  }
  for (const std::uint32_t v : all) link(v, id);
  const auto after = poses_of(id);
  touched_.insert(touched_.end(), after.begin(), after.end());
  mark_dirty(id);
}

// Those of a prior's variables that are fixed become constants.
void IncrementalSolver::put_fixed_in(Prior& prior) const {
  const RowsTerm& all = prior.all;
  RowsTerm active;
  place_columns(all.variables, active.variables, active.offsets);
  active.rows.residual = all.rows.residual;
  active.rows.jacobian.resize(all.rows.jacobian.rows(), active.offsets.back());
  Eigen::Index column = 0;
  for (std::size_t k = 0; k < all.variables.size(); ++k) {
    const auto columns =
        all.rows.jacobian.middleCols(all.offsets[k], all.offsets[k + 1] - all.offsets[k]);
    if (variables_[all.variables[k]].fixed) {
      active.rows.residual += columns * tree_.delta_of(all.variables[k]);
    } else {
      active.rows.jacobian.middleCols(column, columns.cols()) = columns;
      column += columns.cols();
    }
  }
  if (active.variables.empty()) active.rows = {};
  prior.active = std::move(active);
}

void IncrementalSolver::set_fixed(const GraphVariable& given, bool fixed) {
  const std::uint32_t index = variable_of(given);
  Variable& variable = variables_[index];
  if (variable.fixed == fixed) return;
  if (variable.gone) refuse_because("variable", given.index, "was marginalised");
  take_apart(variable.terms);
  take_apart(variable.dormant);
  std::vector<std::uint32_t> ids = variable.terms;
  ids.insert(ids.end(), variable.mixed.begin(), variable.mixed.end());
  ids.insert(ids.end(), variable.dormant.begin(), variable.dormant.end());
  // A block that rides has its pose in its terms only while it varies.
  for (const std::uint32_t id : ids) {
    for (const std::uint32_t v : all_variables_of_term(id)) unlink(v, id);
  }
  if (fixed) {
    if (variable.is_block) blocks_[variable.index].given.values = block(variable.index);
    fold(index);
  } else if (variable.is_block) {
    Block& block = blocks_[variable.index];
    block.inner = block.given.values;
    const Eigen::Matrix3d rotation = carrier_rotation(block);
    for (const int start : block.given.world_vectors) {
      block.inner.segment<3>(start) = rotation * block.given.values.segment<3>(start);
    }
    block.folded_delta = tree_.delta_of(index);
  }
  variable.fixed = fixed;
  touched_.push_back(index);
  for (const std::uint32_t id : ids) refresh(id);
}

void IncrementalSolver::marginalize(const std::vector<GraphVariable>& given) {
  std::vector<std::uint32_t> variables;
  for (const GraphVariable& variable : given) {
    const std::uint32_t v = variable_of(variable);
    if (variables_[v].fixed) refuse_because("variable", variable.index, "does not vary");
    add_once(variables, v);
  }
  if (!variables.empty()) marginalize_variables(variables);
}

}  // namespace hybrid_slam
