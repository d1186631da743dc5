#include "backend/problem/block_cholesky.h"

#include <algorithm>

#include <Eigen/CholmodSupport>
#include <Eigen/OrderingMethods>

#include "backend/problem/openmp_threads.h"

namespace hybrid_slam {

namespace {

// For each node its place in the order of elimination, or kNone.
std::vector<int> elimination_order(const std::vector<BlockPattern::Coupling>& couplings,
                                   const std::vector<char>& known) {
  std::vector<int> index(known.size(), BlockPattern::kNone);
  int unknowns = 0;
  for (std::size_t i = 0; i < known.size(); ++i) {
    if (!known[i]) index[i] = unknowns++;
  }
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(2 * couplings.size() + known.size());
  for (int i = 0; i < unknowns; ++i) entries.emplace_back(i, i, 1);  // Eigen asks for a diagonal
  for (const auto& [first, second] : couplings) {
    const int i = index[first];
    const int j = index[second];
    if (i == BlockPattern::kNone || j == BlockPattern::kNone) continue;
    entries.emplace_back(i, j, 1);
    entries.emplace_back(j, i, 1);
  }
  Eigen::SparseMatrix<double> adjacency(unknowns, unknowns);
  adjacency.setFromTriplets(entries.begin(), entries.end());
  Eigen::AMDOrdering<int>::PermutationType from_new;
  Eigen::AMDOrdering<int>()(adjacency, from_new);
  const Eigen::AMDOrdering<int>::PermutationType to_new(from_new.inverse());
  for (int& i : index) {
    if (i != BlockPattern::kNone) i = to_new.indices()[i];
  }
  return index;
}

}  // namespace

BlockPattern::BlockPattern(const std::vector<Coupling>& couplings, const std::vector<char>& known)
    : row_of_(elimination_order(couplings, known)), slots_(couplings.size()) {
  const auto unknowns = static_cast<int>(std::count(known.begin(), known.end(), 0));
  std::vector<std::pair<int, int>> blocks;  // column, row
  for (int i = 0; i < unknowns; ++i) blocks.emplace_back(i, i);
  for (std::size_t e = 0; e < couplings.size(); ++e) {
    const int first = row(couplings[e].first);
    const int second = row(couplings[e].second);
    if (first == kNone || second == kNone) continue;
    slots_[e] = {std::min(first, second), 0, first < second};
    blocks.emplace_back(slots_[e].column, std::max(first, second));
  }
  std::sort(blocks.begin(), blocks.end());
  blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
  column_begin_.assign(static_cast<std::size_t>(unknowns) + 1, 0);
  for (const auto& [column, row] : blocks) {
    ++column_begin_[static_cast<std::size_t>(column) + 1];
    rows_.push_back(row);
  }
  for (std::size_t i = 1; i < column_begin_.size(); ++i) column_begin_[i] += column_begin_[i - 1];
  for (std::size_t e = 0; e < couplings.size(); ++e) {
    Slot& slot = slots_[e];
    if (slot.column == kNone) continue;
    slot.position =
        position(slot.column, std::max(row(couplings[e].first), row(couplings[e].second)));
  }
}

int BlockPattern::position(int column, int row) const {
  const auto begin = rows_.begin() + column_begin(column);
  const auto end = rows_.begin() + column_begin(column + 1);
  return static_cast<int>(std::lower_bound(begin, end, row) - begin);
}

template <int kSize>
BlockMatrix<kSize>::BlockMatrix(const BlockPattern& pattern)
    : pattern_(pattern), lower_(kSize * pattern.rows(), kSize * pattern.rows()) {
  lower_.resizeNonZeros(Eigen::Index{kSize * kSize} * pattern.column_begin(pattern.rows()));
  for (int column = 0; column < pattern.rows(); ++column) {
    const int size = pattern.column_size(column);
    for (int j = 0; j < kSize; ++j) {
      const int begin = kSize * (kSize * pattern.column_begin(column) + j * size);
      lower_.outerIndexPtr()[kSize * column + j] = begin;
      for (int i = 0; i < kSize * size; ++i) {
        lower_.innerIndexPtr()[begin + i] = kSize * pattern.row_at(column, i / kSize) + i % kSize;
      }
    }
  }
  lower_.outerIndexPtr()[lower_.cols()] = static_cast<int>(lower_.data().size());
  set_zero();
}

template <int kSize>
void BlockMatrix<kSize>::set_zero() {
  lower_.coeffs().setZero();
}

template <int kSize>
Eigen::VectorXd BlockMatrix<kSize>::operator*(const Eigen::VectorXd& x) const {
  Eigen::VectorXd y = Eigen::VectorXd::Zero(x.size());
  for (int column = 0; column < pattern_.rows(); ++column) {
    const Eigen::Matrix<double, kSize, 1> x_column = x.template segment<kSize>(kSize * column);
    Eigen::Matrix<double, kSize, 1> y_column = at(column, 0) * x_column;
    for (int k = 1; k < pattern_.column_size(column); ++k) {
      const int row = kSize * pattern_.row_at(column, k);
      const Block block = at(column, k);
      y.template segment<kSize>(row).noalias() += block * x_column;
      y_column.noalias() += block.transpose() * x.template segment<kSize>(row);
    }
    y.template segment<kSize>(kSize * column) += y_column;
  }
  return y;
}

struct BlockCholesky::Factor {
  Eigen::CholmodDecomposition<Eigen::SparseMatrix<double>, Eigen::Lower> cholmod;
  bool analysed = false;
};

BlockCholesky::BlockCholesky() : factor_(std::make_unique<Factor>()) {
  cholmod_common& settings = factor_->cholmod.cholmod();
  settings.nmethods = 1;  // the blocks are in a good order already
  settings.method[0].ordering = CHOLMOD_NATURAL;
  settings.print = 0;
}

BlockCholesky::~BlockCholesky() = default;
BlockCholesky::BlockCholesky(BlockCholesky&&) noexcept = default;

bool BlockCholesky::factorize(const Eigen::SparseMatrix<double>& lower) {
  allow_openmp_threads(false);
  if (!factor_->analysed) factor_->cholmod.analyzePattern(lower);
  factor_->analysed = true;
  factor_->cholmod.factorize(lower);
  return factor_->cholmod.info() == Eigen::Success;
}

Eigen::MatrixXd BlockCholesky::solve(const Eigen::MatrixXd& right) const {
  return factor_->cholmod.solve(right);
}

template class BlockMatrix<1>;
template class BlockMatrix<3>;
template class BlockMatrix<6>;

}  // namespace hybrid_slam
