#include <algorithm>
#include <map>

#include "backend/incremental/pose_tree.h"

// Covariances from a PoseTree.

namespace hybrid_slam {

namespace {

// Some columns, of which the rows are kept by variable; rows that are not there are zero.
class KeptRows {
 public:
  KeptRows(const PoseTree& tree, Eigen::Index count) : tree_(tree), count_(count) {}

  Eigen::MatrixXd gather(const std::vector<std::uint32_t>& variables, Eigen::Index rows) const {
    Eigen::MatrixXd gathered = Eigen::MatrixXd::Zero(rows, count_);
    Eigen::Index row = 0;
    for (const std::uint32_t variable : variables) {
      const auto found = rows_.find(variable);
      if (found != rows_.end()) gathered.middleRows(row, found->second.rows()) = found->second;
      row += tree_.size(variable);
    }
    return gathered;
  }

  void scatter(const std::vector<std::uint32_t>& variables, const Eigen::MatrixXd& gathered) {
    Eigen::Index row = 0;
    for (const std::uint32_t variable : variables) {
      rows_[variable] = gathered.middleRows(row, tree_.size(variable));
      row += tree_.size(variable);
    }
  }

 private:
  const PoseTree& tree_;
  Eigen::Index count_;
  std::map<std::uint32_t, Eigen::MatrixXd> rows_;
};

}  // namespace

// The cliques of these variables and all above, those below before those above. Stops once they
// have `most` numbers.
std::vector<std::int32_t> PoseTree::paths_to_roots(std::span<const std::uint32_t> variables,
                                                   std::size_t most) const {
  std::map<std::int32_t, std::size_t> depth;  // by clique: how far from its root
  std::size_t numbers = 0;
  for (const std::uint32_t variable : variables) {
    if (numbers >= most) break;
    std::vector<std::int32_t> path;
    for (std::int32_t i = clique_of_[variable]; i != kNone && !depth.contains(i);
         i = at(i).parent) {
      path.push_back(i);
    }
    for (std::size_t k = path.size(); k-- > 0;) {
      const std::int32_t parent = at(path[k]).parent;
      depth[path[k]] = parent == kNone ? 0 : depth.at(parent) + 1;
      numbers += static_cast<std::size_t>(at(path[k]).factor.size() + at(path[k]).narrow.size());
    }
  }
  std::vector<std::int32_t> cliques;
  for (const auto& [clique, steps] : depth) cliques.push_back(clique);
  std::stable_sort(cliques.begin(), cliques.end(),
                   [&](std::int32_t a, std::int32_t b) { return depth.at(a) > depth.at(b); });
  return cliques;
}

// Forward and back substitution with the variables' unit vectors, which concern their cliques and
// those above only: every variable above is frontal in one of these.
Eigen::MatrixXd PoseTree::covariance(std::span<const std::uint32_t> variables) const {
  const std::vector<std::uint32_t> wanted(variables.begin(), variables.end());
  const Eigen::Index count = rows_of(wanted);
  Eigen::MatrixXd units = Eigen::MatrixXd::Identity(count, count);
  Eigen::Index row = 0;
  for (const std::uint32_t variable : wanted) {
    if (clique_of_[variable] == kNone) units.middleRows(row, size(variable)).setZero();
    row += size(variable);
  }
  KeptRows columns(*this, count);
  columns.scatter(wanted, units);
  const std::vector<std::int32_t> cliques = paths_to_roots(variables);
  Eigen::MatrixXd wide;
  for (const std::int32_t i : cliques) {
    const Clique& clique = at(i);
    const Eigen::MatrixXd& factor = factor_of(clique, wide);
    const Eigen::Index f = factor.cols();
    const Eigen::Index s = clique.separator_rows();
    Eigen::MatrixXd solved = columns.gather(clique.frontals, f);
    factor.topRows(f).triangularView<Eigen::Lower>().solveInPlace(solved);
    columns.scatter(clique.frontals, solved);
    if (s == 0) continue;
    Eigen::MatrixXd above = columns.gather(clique.separator, s);
    above.noalias() -= factor.middleRows(f, s) * solved;
    columns.scatter(clique.separator, above);
  }
  for (std::size_t k = cliques.size(); k-- > 0;) {
    const Clique& clique = at(cliques[k]);
    const Eigen::MatrixXd& factor = factor_of(clique, wide);
    const Eigen::Index f = factor.cols();
    const Eigen::Index s = clique.separator_rows();
    Eigen::MatrixXd right = columns.gather(clique.frontals, f);
    if (s > 0) {
      right.noalias() -= factor.middleRows(f, s).transpose() * columns.gather(clique.separator, s);
    }
    factor.topRows(f).triangularView<Eigen::Lower>().transpose().solveInPlace(right);
    columns.scatter(clique.frontals, right);
  }
  return columns.gather(wanted, count);
}

CholeskyPaths PoseTree::paths(std::span<const std::uint32_t> variables, std::size_t most) const {
  const std::vector<std::int32_t> cliques = paths_to_roots(variables, most);
  CholeskyPaths result;
  for (const std::int32_t i : cliques) {
    result.variables.insert(result.variables.end(), at(i).frontals.begin(), at(i).frontals.end());
  }
  std::sort(result.variables.begin(), result.variables.end());
  for (const std::uint32_t variable : result.variables) {
    result.offsets.push_back(result.rows() + size(variable));
  }
  const auto places = [&](const std::vector<std::uint32_t>& of) {
    std::vector<std::uint32_t> found;
    for (const std::uint32_t variable : of) {
      const auto place =
          std::lower_bound(result.variables.begin(), result.variables.end(), variable);
      found.push_back(static_cast<std::uint32_t>(place - result.variables.begin()));
    }
    return found;
  };
  Eigen::MatrixXd wide;
  for (const std::int32_t i : cliques) {
    const Clique& clique = at(i);
    const Eigen::MatrixXd& factor = factor_of(clique, wide);
    result.cliques.push_back({places(clique.frontals), places(clique.separator),
                              factor.topRows(factor.cols() + clique.separator_rows())});
  }
  return result;
}

}  // namespace hybrid_slam
