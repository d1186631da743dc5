#include "backend/problem/block_cholesky.h"

#include <Eigen/Cholesky>

#include "test/support/random.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

struct RandomSystem {
  std::vector<BlockPattern::Coupling> couplings;
  std::vector<char> known;
};

RandomSystem random_system(std::uint32_t nodes, int couplings, Random& random) {
  RandomSystem system;
  system.known.assign(nodes, 0);
  for (std::uint32_t i = 0; i < nodes; i += 7) system.known[i] = 1;
  for (int i = 0; i < couplings; ++i) {
    const auto a = static_cast<std::uint32_t>(random.below(nodes));
    const auto b = static_cast<std::uint32_t>((a + 1 + random.below(nodes - 1)) % nodes);
    system.couplings.emplace_back(a, b);
  }
  return system;
}

// Fills matrix and its dense twin: positive definite, couplings that repeat add up.
template <int kSize>
Eigen::MatrixXd fill(const RandomSystem& system, BlockMatrix<kSize>& matrix, Random& random) {
  using Block = Eigen::Matrix<double, kSize, kSize>;
  const BlockPattern& pattern = matrix.pattern();
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(kSize * pattern.rows(), kSize * pattern.rows());
  for (int row = 0; row < pattern.rows(); ++row) {
    const Block block = 50 * Block::Identity() + Block::Constant(random.uniform());
    matrix.add_to_diagonal(row, block);
    dense.block<kSize, kSize>(kSize * row, kSize * row) += block;
  }
  for (std::size_t e = 0; e < system.couplings.size(); ++e) {
    if (pattern.slot(e).column == BlockPattern::kNone) continue;
    Block block;
    for (double& value : block.reshaped()) value = random.uniform(-1, 1);
    matrix.add(pattern.slot(e), block);
    const int a = kSize * pattern.row(system.couplings[e].first);
    const int b = kSize * pattern.row(system.couplings[e].second);
    dense.block<kSize, kSize>(a, b) += block;
    dense.block<kSize, kSize>(b, a) += block.transpose();
  }
  return dense;
}

template <int kSize>
void check_against_dense(std::uint64_t seed) {
  Random random(seed);
  const RandomSystem system = random_system(40, 90, random);
  const BlockPattern pattern(system.couplings, system.known);
  REQUIRE(pattern.rows() == 34);
  BlockMatrix<kSize> matrix(pattern);
  BlockCholesky cholesky;
  for (int round = 0; round < 2; ++round) {  // the second one uses the structure of the first
    matrix.set_zero();
    const Eigen::MatrixXd dense = fill<kSize>(system, matrix, random);
    const Eigen::VectorXd x = random.vector(kSize * 34, 1);
    CHECK((matrix * x - dense * x).norm() < 1e-12 * (dense * x).norm());
    REQUIRE(cholesky.factorize(matrix.lower()));
    CHECK((cholesky.solve(dense * x) - x).norm() < 1e-12 * x.norm());
  }
}

TEST_CASE("block matrices and their factors equal dense ones") {
  check_against_dense<1>(1);
  check_against_dense<3>(2);
  check_against_dense<6>(3);
}

TEST_CASE("known nodes have no row, the others one each") {
  Random random(4);
  const RandomSystem system = random_system(40, 90, random);
  const BlockPattern pattern(system.couplings, system.known);
  std::vector<int> uses(34, 0);
  for (std::size_t i = 0; i < system.known.size(); ++i) {
    if (system.known[i]) {
      CHECK(pattern.row(i) == BlockPattern::kNone);
    } else {
      ++uses.at(static_cast<std::size_t>(pattern.row(i)));
    }
  }
  CHECK(uses == std::vector<int>(34, 1));
}

TEST_CASE("an indefinite matrix has no factor") {
  const std::vector<BlockPattern::Coupling> couplings = {{0, 1}};
  const BlockPattern pattern(couplings, {0, 0});
  BlockMatrix<1> matrix(pattern);
  matrix.add(pattern.slot(0), Eigen::Matrix<double, 1, 1>(1.0));  // eigenvalues 1 and -1
  CHECK_FALSE(BlockCholesky().factorize(matrix.lower()));
}

}  // namespace
}  // namespace hybrid_slam
