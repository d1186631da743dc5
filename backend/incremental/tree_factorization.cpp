#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/Cholesky>

#include "backend/incremental/pose_tree.h"

// Factors the cliques of a PoseTree, and keeps what they hand to their parents, or not.

namespace hybrid_slam {

namespace {

// A pivot below this part of what terms added to its diagonal is rounding: some thousand
// eliminations, one after another, each with the precision of a double.
constexpr double kPivotRounding = 1e-12;

// What a diagonal entry of a front is measured by.
double unit_of(Front& front, Eigen::Index i) {
  return std::max(front.scale()[i], front.matrix()(i, i));
}

}  // namespace

// Multiplications of a partial Cholesky of f of f + s rows.
double PoseTree::factor_cost(Eigen::Index frontals, Eigen::Index separator) {
  const auto f = static_cast<double>(frontals);
  const auto s = static_cast<double>(separator);
  return f * f * f / 6 + f * f * s / 2 + f * s * s / 2;
}

// The clique's terms and all below are what they were when it was factored.
void PoseTree::restore_contribution(std::int32_t index, const TermSource& terms) {
  if (at(index).packed.size() > 0) unpack(at(index));
  if (at(index).contribution.cols() == at(index).separator_rows()) return;
  for (const std::int32_t child : at(index).children) restore_contribution(child, terms);
  const bool fresh = at(index).fresh;
  factor(index, own_terms(at(index), terms), terms);
  at(index).fresh = fresh;
  if (!at(index).settled) return;
  narrow(at(index));
  forget_contributions(at(index));
}

// What is below a clique that was left as it is will not be factored soon.
void PoseTree::settle(std::int32_t index) {
  if (at(index).settled) return;
  at(index).settled = true;
  narrow(at(index));
  forget_contributions(at(index));
  for (const std::int32_t child : at(index).children) settle(child);
}

// Of its children.
void PoseTree::forget_contributions(const Clique& clique) {
  for (const std::int32_t child : clique.children) {
    if ((at(child).height + 1) % options_.levels_kept == 0) pack(at(child));
    at(child).contribution.resize(0, 0);
  }
}

void PoseTree::narrow(Clique& clique) const {
  if (clique.separator_rows() < options_.narrow_from) return;
  clique.narrow = clique.factor.cast<float>();
  clique.factor.resize(0, 0);
}

// A clique's factor in double precision, in `scratch` where it is not kept so.
const Eigen::MatrixXd& PoseTree::factor_of(const Clique& clique, Eigen::MatrixXd& scratch) {
  if (clique.narrow.size() == 0) return clique.factor;
  scratch.resize(clique.narrow.rows(), clique.narrow.cols());
  std::copy_n(clique.narrow.data(), clique.narrow.size(), scratch.data());
  return scratch;
}

// The lower triangle is all that there is to know, and half of the memory.
void PoseTree::pack(Clique& clique) {
  const Eigen::MatrixXd& full = clique.contribution;
  if (full.size() == 0) return;
  const Eigen::Index rows = full.rows();
  clique.packed.resize(full.cols() * (rows + 2) / 2);
  Eigen::Index at = 0;
  for (Eigen::Index column = 0; column < full.cols(); ++column) {
    clique.packed.segment(at, rows - column) = full.col(column).tail(rows - column);
    at += rows - column;
  }
}

void PoseTree::unpack(Clique& clique) {
  const Eigen::Index rows = clique.separator_rows() + 1;
  clique.contribution.setZero(rows, rows - 1);
  Eigen::Index at = 0;
  for (Eigen::Index column = 0; column + 1 < rows; ++column) {
    clique.contribution.col(column).tail(rows - column) = clique.packed.segment(at, rows - column);
    at += rows - column;
  }
  clique.packed.resize(0);
}

void PoseTree::add_contribution(const Clique& child, Front& front) const {
  const std::size_t count = child.separator.size();
  const Eigen::Index rows = child.separator_rows();
  Eigen::Index column = 0;
  for (std::size_t j = 0; j < count; ++j) {
    const std::uint32_t slot_j = front.slot(child.separator[j]);
    const Eigen::Index width = size(child.separator[j]);
    Eigen::Index row = column;
    for (std::size_t i = j; i < count; ++i) {
      const Eigen::Index height = size(child.separator[i]);
      const std::uint32_t slot_i = front.slot(child.separator[i]);
      if (height == 6 && width == 6) {
        front.add(slot_i, slot_j, child.contribution.block<6, 6>(row, column));
      } else {
        front.add(slot_i, slot_j, child.contribution.block(row, column, height, width));
      }
      row += height;
    }
    front.add_gradient(slot_j, child.contribution.row(rows).segment(column, width).transpose());
    front.add_scale(slot_j, child.scale.segment(column, width).cast<double>());
    column += width;
  }
}

void PoseTree::damp(const Clique& clique, Front& front) const {
  for (const std::uint32_t pose : clique.frontals) {
    if (damping_[pose] == 0) continue;
    const std::uint32_t slot = front.slot(pose);
    const Eigen::VectorXd weight =
        damping_[pose] * front.scale().segment(front.row(slot), size(pose));
    front.add(slot, slot, Eigen::MatrixXd(weight.asDiagonal()));
    front.add_gradient(slot, Eigen::VectorXd(-weight.cwiseProduct(delta_of(pose))));
  }
}

// The Cholesky factor of the frontals' block, in place.
void PoseTree::factor_frontals(Clique& clique, Front& front) {
  const Eigen::Index f = clique.factor.cols();
  auto block = clique.factor.topRows(f);
  const Eigen::LLT<Eigen::MatrixXd> llt(block);
  bool sound = llt.info() == Eigen::Success;
  for (Eigen::Index i = 0; sound && i < f; ++i) {
    const double root = llt.matrixLLT()(i, i);
    sound = root * root > kPivotRounding * unit_of(front, i);
  }
  if (sound) {
    block = llt.matrixL();
    return;
  }
  ++singular_;
  last_undetermined_ += factor_held(clique, front);
}

// The same, one column after the other: where a pivot is rounding, the direction's present delta
// counts as measured. Returns how many were.
std::size_t PoseTree::factor_held(Clique& clique, Front& front) const {
  const Eigen::Index f = clique.factor.cols();
  auto block = clique.factor.topRows(f);
  auto gradient = clique.factor.bottomRows<1>();
  Eigen::VectorXd present(f);
  Eigen::Index row = 0;
  for (const std::uint32_t pose : clique.frontals) {
    present.segment(row, size(pose)) = delta_of(pose);
    row += size(pose);
  }
  std::size_t held = 0;
  for (Eigen::Index j = 0; j < f; ++j) {
    const double size = unit_of(front, j);
    const double unit = size > 0 ? size : 1;
    if (!(block(j, j) > kPivotRounding * unit)) {
      const double weight = options_.hold * unit;
      block(j, j) = std::max(block(j, j), 0.0) + weight;
      gradient[j] -= weight * present[j];
      ++held;
    }
    const Eigen::Index rest = f - j - 1;
    block(j, j) = std::sqrt(block(j, j));
    auto column = block.col(j).tail(rest);
    column /= block(j, j);
    block.bottomRightCorner(rest, rest).selfadjointView<Eigen::Lower>().rankUpdate(column, -1);
    block.row(j).tail(rest).setZero();
  }
  return held;
}

// What its terms and its children hand to a clique, its frontals first.
Front PoseTree::assemble(const Clique& clique, const std::vector<std::uint32_t>& own,
                         const TermSource& terms) {
  std::uint32_t slot = 0;
  std::vector<Eigen::Index> offsets;
  offsets.reserve(clique.frontals.size() + clique.separator.size() + 1);
  offsets.push_back(0);
  for (const auto* members : {&clique.frontals, &clique.separator}) {
    for (const std::uint32_t pose : *members) {
      slot_of_[pose] = slot++;
      offsets.push_back(offsets.back() + size(pose));
    }
  }
  Front front(std::move(offsets), slot_of_);
  for (std::size_t i = 0; i < own.size(); ++i) {
    terms.fetch(own, i);
    terms.assemble(own[i], front);
  }
  for (const std::int32_t child : clique.children) add_contribution(at(child), front);
  damp(clique, front);
  return front;
}

void PoseTree::factor(std::int32_t index, const std::vector<std::uint32_t>& own,
                      const TermSource& terms) {
  Clique& clique = at(index);
  Front front = assemble(clique, own, terms);
  clique.height = 0;
  for (const std::int32_t child : clique.children) {
    clique.height = std::max(clique.height, at(child).height + 1);
  }
  eliminate_frontals(clique, front);
  clique.fresh = true;
  last_cost_ += factor_cost(clique.frontal_rows(), clique.separator_rows());
}

// Leaves the columns of the factor, and what they leave on the separator.
void PoseTree::eliminate_frontals(Clique& clique, Front& front) {
  const Eigen::Index f = rows_of(clique.frontals);
  const Eigen::Index s = rows_of(clique.separator);
  Eigen::MatrixXd& matrix = front.matrix();
  clique.factor = matrix.leftCols(f);
  clique.narrow.resize(0, 0);
  clique.contribution = matrix.bottomRightCorner(s + 1, s);
  clique.scale = front.scale().tail(s).cast<float>();
  factor_frontals(clique, front);
  if (!clique.factor.topRows(f).diagonal().allFinite() || !clique.factor.row(f + s).allFinite()) {
    throw std::logic_error("PoseTree: a term is not finite");
  }
  auto below = clique.factor.bottomRows(s + 1);
  clique.factor.topRows(f)
      .triangularView<Eigen::Lower>()
      .transpose()
      .solveInPlace<Eigen::OnTheRight>(below);
  if (s > 0) {
    const auto separator = clique.factor.middleRows(f, s);
    clique.contribution.topRows(s).selfadjointView<Eigen::Lower>().rankUpdate(separator, -1);
    clique.contribution.row(s).noalias() -= clique.factor.row(f + s) * separator.transpose();
  }
}

}  // namespace hybrid_slam
