#include "backend/map/keyframe_covariances.h"

#include <algorithm>
#include <stdexcept>

namespace hybrid_slam {

// With X = L^-1 B^T it is X^T X, and rows of X are final where their clique is passed.
Eigen::MatrixXd CholeskyPaths::covariance(Eigen::MatrixXd transposed) const {
  const Eigen::Index count = transposed.cols();
  Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(count, count);
  Eigen::MatrixXd solved;
  Eigen::MatrixXd handed_on;
  for (const Clique& clique : cliques) {
    const Eigen::Index f = clique.factor.cols();
    const Eigen::Index s = clique.factor.rows() - f;
    solved.resize(f, count);
    Eigen::Index row = 0;
    for (const std::uint32_t at : clique.frontals) {
      solved.middleRows(row, size(at)) = transposed.middleRows(offsets[at], size(at));
      row += size(at);
    }
    if (solved.isZero(0)) continue;
    clique.factor.topRows(f).triangularView<Eigen::Lower>().solveInPlace(solved);
    sum.noalias() += solved.transpose() * solved;
    handed_on.noalias() = clique.factor.bottomRows(s) * solved;
    row = 0;
    for (const std::uint32_t at : clique.separator) {
      transposed.middleRows(offsets[at], size(at)) -= handed_on.middleRows(row, size(at));
      row += size(at);
    }
  }
  return sum;
}

KeyframeCovariances::KeyframeCovariances(KeyframeId origin, CholeskyPaths paths,
                                         std::vector<Known> known)
    : origin_(origin), paths_(std::move(paths)), known_(std::move(known)) {}

const KeyframeCovariances::Known* KeyframeCovariances::find(KeyframeId id) const {
  const auto found =
      std::lower_bound(known_.begin(), known_.end(), id,
                       [](const Known& known, KeyframeId wanted) { return known.id < wanted; });
  return found != known_.end() && found->id == id ? &*found : nullptr;
}

Matrix6d KeyframeCovariances::covariance(KeyframeId id) const {
  const Derivative itself(id, Matrix6d::Identity());
  return covariance(std::span(&itself, 1));
}

Eigen::MatrixXd KeyframeCovariances::covariance(std::span<const Derivative> derivatives) const {
  Eigen::MatrixXd transposed =
      Eigen::MatrixXd::Zero(paths_.rows(), derivatives.front().second.rows());
  for (const auto& [id, derivative] : derivatives) {
    if (id == origin_) continue;
    const Known* known = find(id);
    if (known == nullptr) {
      throw std::logic_error("KeyframeCovariances::covariance: a keyframe that is not known");
    }
    transposed.middleRows<6>(paths_.offsets[known->at]) +=
        known->by_variable.transpose() * derivative.transpose();
  }
  return paths_.covariance(std::move(transposed));
}

}  // namespace hybrid_slam
