#include <ceres/cost_function.h>

#include <algorithm>
#include <numeric>

#include "backend/incremental/incremental_solver.h"

// How an IncrementalSolver lets go of old poses.

namespace hybrid_slam {

namespace {

// Variables as columns of a linear system.
class Columns {
 public:
  explicit Columns(const PoseTree& tree) : tree_(tree) {}

  void add(std::uint32_t variable) {
    if (find(variable) == variables_.end()) {
      variables_.push_back(variable);
      offsets_.push_back(offsets_.back() + tree_.size(variable));
    }
  }
  Eigen::Index column(std::uint32_t variable) const {
    return offsets_[static_cast<std::size_t>(find(variable) - variables_.begin())];
  }
  Eigen::Index count() const { return offsets_.back(); }
  const std::vector<std::uint32_t>& variables() const { return variables_; }

 private:
  std::vector<std::uint32_t>::const_iterator find(std::uint32_t variable) const {
    return std::find(variables_.begin(), variables_.end(), variable);
  }

  const PoseTree& tree_;
  std::vector<std::uint32_t> variables_;
  std::vector<Eigen::Index> offsets_{0};
};

// The rows of a term over its own poses.
LinearSystem rows_of_edge(const EdgeTerm& edge) {
  LinearSystem rows{Eigen::MatrixXd(6, 6 * edge.variable), edge.residual};
  for (std::size_t i = 0; i < edge.variable; ++i) {
    rows.jacobian.middleCols<6>(static_cast<Eigen::Index>(6 * i)) = edge.by_pose[i];
  }
  return rows;
}

}  // namespace

// Without the landmark. Views that are not usable leave zeros.
LinearSystem IncrementalSolver::rows_of(const LandmarkTerm& landmark) const {
  Columns columns(tree_);
  for (const std::uint32_t variable : landmark.poses) columns.add(variable);
  auto count = static_cast<Eigen::Index>(3 * landmark.views.size());
  for (const FactorView& view : landmark.factors) count += view.rows.residual.size();
  LinearSystem rows{Eigen::MatrixXd::Zero(count, 3 + columns.count()),
                    Eigen::VectorXd::Zero(count)};
  Eigen::Index row = 0;
  for (const LandmarkView& view : landmark.views) {
    if (view.usable) {
      rows.jacobian.block<3, 3>(row, 0) = view.by_point;
      rows.residual.segment<3>(row) = view.residual;
      if (!view.fixed) {
        rows.jacobian.block<3, 6>(row, 3 + columns.column(view.pose)) = view.by_pose;
      }
    }
    row += 3;
  }
  for (const FactorView& view : landmark.factors) {
    const Eigen::Index own = view.rows.residual.size();
    if (view.usable) {
      rows.jacobian.block(row, 0, own, 3) = view.by_point;
      rows.residual.segment(row, own) = view.rows.residual;
      for (std::size_t i = 0; i < view.variables.size(); ++i) {
        const Eigen::Index width = view.offsets[i + 1] - view.offsets[i];
        rows.jacobian.block(row, 3 + columns.column(view.variables[i]), own, width) =
            view.rows.jacobian.middleCols(view.offsets[i], width);
      }
    }
    row += own;
  }
  return hybrid_slam::marginalize(rows, 3);
}

LinearSystem IncrementalSolver::rows_of_term(std::uint32_t id) const {
  const Term& term = terms_[id];
  switch (term.kind) {
    case TermKind::kEdge:
      return rows_of_edge(edge_terms_[term.index]);
    case TermKind::kLandmark:
      return rows_of(*landmarks_[term.index]);
    case TermKind::kFactor: {
      const RowsTerm& rows = factor_terms_[term.index];
      if (rows.rows.residual.size() > 0) return rows.rows;
      return {Eigen::MatrixXd(0, rows.offsets.back()), Eigen::VectorXd(0)};
    }
    case TermKind::kCondensed:
      throw std::logic_error("IncrementalSolver::rows_of_term: a condensed term has none");
    case TermKind::kPrior:
      break;
  }
  return priors_[term.index].active.rows;
}

// Linearises the terms at the present estimate, minimises the variables and the landmarks they see
// out of them, and puts what that leaves on others in their place. Blocks go with what they ride
// on.
void IncrementalSolver::marginalize_variables(const std::vector<std::uint32_t>& given) {
  Columns columns(tree_);
  for (const std::uint32_t variable : given) columns.add(variable);
  for (const Block& block : blocks_) {
    if (block.there && !variables_[block.variable].fixed &&
        std::find(given.begin(), given.end(), block.carrier) != given.end()) {
      columns.add(block.variable);
    }
  }
  const std::vector<std::uint32_t> leaving = columns.variables();
  for (const std::uint32_t variable : leaving) take_apart(variables_[variable].terms);
  const Eigen::Index leaving_columns = columns.count();
  std::vector<std::uint32_t> ids;
  for (const std::uint32_t variable : leaving) {
    const Variable& of = variables_[variable];
    ids.insert(ids.end(), of.terms.begin(), of.terms.end());
    ids.insert(ids.end(), of.mixed.begin(), of.mixed.end());
  }
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  std::vector<LinearSystem> systems;
  Eigen::Index row_count = 0;
  for (const std::uint32_t id : ids) {
    linearize(id);
    systems.push_back(rows_of_term(id));
    row_count += systems.back().residual.size();
    for (const std::uint32_t variable : poses_of(id)) columns.add(variable);
  }

  LinearSystem all{Eigen::MatrixXd::Zero(row_count, columns.count()), Eigen::VectorXd(row_count)};
  Eigen::Index row = 0;
  for (std::size_t k = 0; k < ids.size(); ++k) {
    const Eigen::Index rows = systems[k].residual.size();
    Eigen::Index column = 0;
    for (const std::uint32_t variable : poses_of(ids[k])) {
      const Eigen::Index width = tree_.size(variable);
      all.jacobian.block(row, columns.column(variable), rows, width) =
          systems[k].jacobian.middleCols(column, width);
      column += width;
    }
    all.residual.segment(row, rows) = systems[k].residual;
    row += rows;
  }
  RowsTerm prior;
  prior.variables.assign(columns.variables().begin() + static_cast<std::ptrdiff_t>(leaving.size()),
                         columns.variables().end());
  for (const std::uint32_t variable : prior.variables) {
    prior.offsets.push_back(prior.offsets.back() + tree_.size(variable));
  }
  prior.rows = hybrid_slam::marginalize(all, leaving_columns);
  for (const std::uint32_t id : ids) drop_term(id);
  for (const std::uint32_t variable : leaving) {
    Variable& of = variables_[variable];
    if (of.is_block) blocks_[of.index].given.values = block(of.index);
    fold(variable);
    of.fixed = of.gone = true;
  }
  if (prior.rows.residual.size() > 0) add_prior(std::move(prior));
}

void IncrementalSolver::add_prior(RowsTerm rows) {
  priors_.push_back({rows, rows});
  const std::uint32_t id =
      add_term(TermKind::kPrior, static_cast<std::uint32_t>(priors_.size()) - 1);
  for (const std::uint32_t variable : poses_of(id)) {
    link(variable, id);
    touched_.push_back(variable);
  }
  terms_[id].cost = evaluate_prior(terms_[id].index).cost;
}

// What a term adds to the sums over all is no longer there.
void IncrementalSolver::forget_sums(std::uint32_t id) {
  Term& term = terms_[id];
  squared_norm_ -= term.squared_norm;
  rows_ -= term.rows;
  mismatch_ -= term.mismatch;
  term.squared_norm = term.mismatch = term.cost = 0;
  term.rows = 0;
}

// The term's information has gone elsewhere. A landmark stays where it is, as if newly made.
void IncrementalSolver::drop_term(std::uint32_t id) {
  Term& term = terms_[id];
  const auto varying = poses_of(id);
  touched_.insert(touched_.end(), varying.begin(), varying.end());
  for (const std::uint32_t variable : all_variables_of_term(id)) unlink(variable, id);
  forget_sums(id);
  const auto forget_factor = [this](std::uint32_t factor) {
    factors_[factor].there = false;
    factors_[factor].function.reset();
    factors_[factor].given = {};
    free_factors_.push_back(factor);
  };
  if (term.kind == TermKind::kEdge) {
    edge_there_[term.index] = 0;
    edge_factors_[term.index].reset();
    edge_terms_[term.index].variable = 0;
  } else if (term.kind == TermKind::kPrior) {
    priors_[term.index] = {};
  } else if (term.kind == TermKind::kFactor) {
    factor_terms_[term.index] = {};
    forget_factor(term.index);
  } else if (term.kind == TermKind::kCondensed) {
    free_condensed_.push_back(term.index);
    condensed_[term.index] = {};
  } else {
    LandmarkTerm& landmark = *landmarks_[term.index];
    for (const LandmarkView& view : landmark.views) {
      observation_there_[view.observation] = 0;
      free_observations_.push_back(view.observation);
    }
    for (const FactorView& view : landmark.factors) forget_factor(view.factor);
    LandmarkTerm renewed;
    renewed.base = point(term.index);
    landmark = std::move(renewed);
  }
}

// Returns the poses that left.
std::vector<std::uint32_t> IncrementalSolver::slide_window() {
  const auto window = static_cast<std::size_t>(options_.window);
  // Several at once: what they see together is taken apart once.
  const std::size_t slack = std::max<std::size_t>(1, window / 10);
  std::vector<std::uint32_t> active;
  for (std::uint32_t i = oldest_; i < poses_.size(); ++i) {
    if (!variables_[poses_[i].variable].fixed) active.push_back(i);
  }
  if (window == 0 || active.size() < window + slack) return {};
  active.resize(active.size() - window);
  std::vector<std::uint32_t> variables;
  for (const std::uint32_t i : active) variables.push_back(poses_[i].variable);
  marginalize_variables(variables);
  oldest_ = active.back() + 1;
  return active;
}

}  // namespace hybrid_slam
