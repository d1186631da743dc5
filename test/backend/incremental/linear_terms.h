#pragma once

#include <cstdint>
#include <vector>

#include "backend/incremental/front.h"
#include "test/support/random.h"

namespace hybrid_slam {

// A linear problem over poses that changes: quadratic functions
//   1/2 x^T H x + g^T x
// of the tangents of a few poses each, with H symmetric and positive definite.
class LinearTerms final : public TermSource {
 public:
  explicit LinearTerms(std::size_t poses) : terms_of_pose_(poses) {}

  std::size_t pose_count() const { return terms_of_pose_.size(); }
  std::size_t term_count() const { return terms_.size(); }

  // On distinct poses. Returns its index.
  std::uint32_t add(const std::vector<std::uint32_t>& poses, const Eigen::MatrixXd& hessian,
                    const Eigen::VectorXd& gradient);
  std::uint32_t add_random(const std::vector<std::uint32_t>& poses, Random& random);
  // Other numbers, the same poses.
  void change(std::uint32_t term, Random& random);
  void remove(std::uint32_t term);
  bool is_there(std::uint32_t term) const { return !terms_[term].poses.empty(); }

  std::span<const std::uint32_t> terms_of(std::uint32_t pose) const override {
    return terms_of_pose_[pose];
  }
  std::span<const std::uint32_t> poses_of(std::uint32_t term) const override {
    return terms_[term].poses;
  }
  void assemble(std::uint32_t term, Front& front) const override;

  // The tangents that minimise the sum of all terms, one column per pose; zero without terms.
  Eigen::Matrix<double, 6, Eigen::Dynamic> dense_solution() const;

 private:
  struct Term {
    std::vector<std::uint32_t> poses;
    Eigen::MatrixXd hessian;
    Eigen::VectorXd gradient;
  };

  std::vector<Term> terms_;
  std::vector<std::vector<std::uint32_t>> terms_of_pose_;
};

}  // namespace hybrid_slam
