#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace hybrid_slam {

// Where the blocks of a symmetric matrix over the unknown nodes of a graph lie: an elimination
// order of the nodes that keeps the Cholesky factor sparse (approximate minimum degree), and the
// lower triangle's block columns. Computed once, for any size of block.
class BlockPattern {
 public:
  static constexpr int kNone = -1;
  using Coupling = std::pair<std::uint32_t, std::uint32_t>;  // two different nodes

  // The block of a coupling: of (row, column) where row > column in the order of elimination.
  struct Slot {
    int column = kNone;    // kNone: one of its nodes is known
    int position = 0;      // in its column; 0 is the diagonal
    bool swapped = false;  // the coupling's first node has the column, its second one the row
  };

  BlockPattern() = default;  // of no nodes

  // known: nodes without a row. Couplings may repeat: they share their block.
  BlockPattern(const std::vector<Coupling>& couplings, const std::vector<char>& known);

  int rows() const { return static_cast<int>(column_begin_.size()) - 1; }
  int row(std::size_t node) const { return row_of_[node]; }  // or kNone
  const Slot& slot(std::size_t coupling) const { return slots_[coupling]; }

  int column_begin(int column) const { return column_begin_[static_cast<std::size_t>(column)]; }
  int column_size(int column) const { return column_begin(column + 1) - column_begin(column); }
  int row_at(int column, int position) const {
    return rows_[static_cast<std::size_t>(column_begin(column)) +
                 static_cast<std::size_t>(position)];
  }
  // Where a row is in a column, which must have it.
  int position(int column, int row) const;

 private:
  std::vector<int> row_of_;
  std::vector<int> column_begin_{0};  // into rows_
  std::vector<int> rows_;             // ascending in each column, which begins with its diagonal
  std::vector<Slot> slots_;
};

// A symmetric matrix of kSize x kSize blocks. The pattern must outlive it.
template <int kSize>
class BlockMatrix {
 public:
  using Block = Eigen::Matrix<double, kSize, kSize>;

  explicit BlockMatrix(const BlockPattern& pattern);

  const BlockPattern& pattern() const { return pattern_; }
  void set_zero();
  void add_to_diagonal(int row, const Block& block) { at(row, 0) += block; }
  // `block` is that of (the coupling's first node, its second one). The slot must have a column.
  void add(const BlockPattern::Slot& slot, const Block& block) {
    if (slot.swapped) {
      at(slot.column, slot.position) += block.transpose();
    } else {
      at(slot.column, slot.position) += block;
    }
  }
  // The same as numbers: a block of the lower triangle begins at offset() in values(), its columns
  // stride() apart.
  double* values() { return lower_.valuePtr(); }
  Eigen::Index offset(int column, int position) const {
    return kSize * (Eigen::Index{kSize} * pattern_.column_begin(column) + position);
  }
  Eigen::Index stride(int column) const {
    return Eigen::Index{kSize} * pattern_.column_size(column);
  }
  Eigen::VectorXd operator*(const Eigen::VectorXd& x) const;

  // Lower triangle; of the blocks on the diagonal the upper part is there too.
  const Eigen::SparseMatrix<double>& lower() const { return lower_; }

 private:
  using BlockMap = Eigen::Map<Block, 0, Eigen::OuterStride<>>;
  using ConstBlockMap = Eigen::Map<const Block, 0, Eigen::OuterStride<>>;

  BlockMap at(int column, int position) {
    return BlockMap(lower_.valuePtr() + offset(column, position),
                    Eigen::OuterStride<>(stride(column)));
  }
  ConstBlockMap at(int column, int position) const {
    return ConstBlockMap(lower_.valuePtr() + offset(column, position),
                         Eigen::OuterStride<>(stride(column)));
  }

  const BlockPattern& pattern_;
  Eigen::SparseMatrix<double> lower_;
};

// Sparse Cholesky factor of a BlockMatrix (CHOLMOD). The structure is analysed once.
class BlockCholesky {
 public:
  BlockCholesky();
  ~BlockCholesky();
  BlockCholesky(BlockCholesky&&) noexcept;

  // False if the matrix is not positive definite. All matrices must have the pattern of the first.
  bool factorize(const Eigen::SparseMatrix<double>& lower);
  Eigen::MatrixXd solve(const Eigen::MatrixXd& right) const;

 private:
  struct Factor;
  std::unique_ptr<Factor> factor_;
};

extern template class BlockMatrix<1>;
extern template class BlockMatrix<3>;
extern template class BlockMatrix<6>;

}  // namespace hybrid_slam
