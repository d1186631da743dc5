#include "test/backend/incremental/linear_terms.h"

#include <Eigen/Cholesky>

namespace hybrid_slam {

namespace {

Eigen::MatrixXd random_hessian(std::size_t poses, Random& random) {
  const auto size = static_cast<Eigen::Index>(6 * poses);
  Eigen::MatrixXd root(size + 2, size);
  for (double& x : root.reshaped()) x = random.uniform(-1, 1);
  return root.transpose() * root + 0.1 * Eigen::MatrixXd::Identity(size, size);
}

}  // namespace

std::uint32_t LinearTerms::add(const std::vector<std::uint32_t>& poses,
                               const Eigen::MatrixXd& hessian, const Eigen::VectorXd& gradient) {
  const auto index = static_cast<std::uint32_t>(terms_.size());
  terms_.push_back({poses, hessian, gradient});
  for (const std::uint32_t pose : poses) terms_of_pose_[pose].push_back(index);
  return index;
}

std::uint32_t LinearTerms::add_random(const std::vector<std::uint32_t>& poses, Random& random) {
  return add(poses, random_hessian(poses.size(), random),
             random.vector(6 * static_cast<int>(poses.size()), 1));
}

void LinearTerms::change(std::uint32_t term, Random& random) {
  Term& t = terms_[term];
  t.hessian = random_hessian(t.poses.size(), random);
  t.gradient = random.vector(static_cast<int>(t.gradient.size()), 1);
}

void LinearTerms::remove(std::uint32_t term) {
  for (const std::uint32_t pose : terms_[term].poses) std::erase(terms_of_pose_[pose], term);
  terms_[term].poses.clear();
}

void LinearTerms::assemble(std::uint32_t term, Front& front) const {
  const Term& t = terms_[term];
  const auto count = static_cast<Eigen::Index>(t.poses.size());
  for (Eigen::Index i = 0; i < count; ++i) {
    const std::uint32_t slot_i = front.slot(t.poses[static_cast<std::size_t>(i)]);
    front.add_gradient(slot_i, t.gradient.segment<6>(6 * i));
    for (Eigen::Index j = 0; j <= i; ++j) {
      front.add(slot_i, front.slot(t.poses[static_cast<std::size_t>(j)]),
                t.hessian.block<6, 6>(6 * i, 6 * j));
    }
  }
}

Eigen::Matrix<double, 6, Eigen::Dynamic> LinearTerms::dense_solution() const {
  const auto size = static_cast<Eigen::Index>(6 * pose_count());
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(size);
  for (const Term& t : terms_) {
    for (std::size_t i = 0; i < t.poses.size(); ++i) {
      const auto from_i = static_cast<Eigen::Index>(6 * i);
      gradient.segment<6>(6 * t.poses[i]) += t.gradient.segment<6>(from_i);
      for (std::size_t j = 0; j < t.poses.size(); ++j) {
        hessian.block<6, 6>(6 * t.poses[i], 6 * t.poses[j]) +=
            t.hessian.block<6, 6>(from_i, static_cast<Eigen::Index>(6 * j));
      }
    }
  }
  for (std::size_t pose = 0; pose < pose_count(); ++pose) {
    if (!terms_of_pose_[pose].empty()) continue;
    const auto at = static_cast<Eigen::Index>(6 * pose);
    hessian.block<6, 6>(at, at).setIdentity();
  }
  return (-hessian.llt().solve(gradient)).reshaped(6, size / 6);
}

}  // namespace hybrid_slam
