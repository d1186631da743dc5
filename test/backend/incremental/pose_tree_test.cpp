#include "backend/incremental/pose_tree.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "test/backend/incremental/linear_terms.h"

#include <catch2/catch.hpp>

namespace hybrid_slam {
namespace {

using Tangents = Eigen::Matrix<double, 6, Eigen::Dynamic>;

Tangents deltas(const PoseTree& tree, std::size_t poses) {
  Tangents result(6, static_cast<Eigen::Index>(poses));
  for (std::uint32_t i = 0; i < poses; ++i) result.col(i) = tree.delta(i);
  return result;
}

// Between the tree and the dense solution, relative, over the poses that have terms.
double mismatch(const PoseTree& tree, const LinearTerms& terms) {
  const Tangents exact = terms.dense_solution();
  double worst = 0;
  for (std::uint32_t i = 0; i < terms.pose_count(); ++i) {
    if (terms.terms_of(i).empty()) continue;
    worst = std::max(worst, (tree.delta(i) - exact.col(i)).cwiseAbs().maxCoeff());
  }
  return worst / std::max(1e-3, exact.cwiseAbs().maxCoeff());
}

// Distinct poses near one another, sometimes one from far away: a loop.
std::vector<std::uint32_t> random_poses(std::size_t count, Random& random) {
  const auto last = static_cast<int>(count) - 1;
  std::vector<std::uint32_t> poses;
  const int centre = random.integer(0, last);
  for (int i = random.integer(1, 6); i > 0; --i) {
    const int near = std::clamp(centre + random.integer(-4, 4), 0, last);
    const int pose = random.uniform() < 0.03 ? random.integer(0, last) : near;
    poses.push_back(static_cast<std::uint32_t>(pose));
  }
  std::sort(poses.begin(), poses.end());
  poses.erase(std::unique(poses.begin(), poses.end()), poses.end());
  // Terms need not name their poses in order.
  for (std::size_t i = poses.size(); i > 1; --i) std::swap(poses[i - 1], poses[random.below(i)]);
  return poses;
}

// One change of a random kind. Returns the poses that it touches.
std::vector<std::uint32_t> edit(LinearTerms& terms, Random& random) {
  const auto some_term = [&] {
    return static_cast<std::uint32_t>(random.below(terms.term_count()));
  };
  const double kind = random.uniform();
  if (terms.term_count() == 0 || kind < 0.5) {
    const auto poses = random_poses(terms.pose_count(), random);
    terms.add_random(poses, random);
    return poses;
  }
  std::vector<std::uint32_t> touched;
  if (kind < 0.7) {
    const std::uint32_t term = some_term();
    const auto poses = terms.poses_of(term);
    touched.assign(poses.begin(), poses.end());
    terms.change(term, random);
  } else if (kind < 0.9) {
    const std::uint32_t term = some_term();
    const auto poses = terms.poses_of(term);
    touched.assign(poses.begin(), poses.end());
    terms.remove(term);
  } else {  // all terms of a pose
    const auto pose = static_cast<std::uint32_t>(random.below(terms.pose_count()));
    const std::vector<std::uint32_t> all(terms.terms_of(pose).begin(), terms.terms_of(pose).end());
    for (const std::uint32_t term : all) {
      const auto poses = terms.poses_of(term);
      touched.insert(touched.end(), poses.begin(), poses.end());
      terms.remove(term);
    }
  }
  return touched;
}

// A chain in time, with a term over each two neighbours; every pose but the first comes with its
// own update.
struct Chain {
  explicit Chain(std::uint32_t count, const PoseTree::Options& options = {})
      : terms(count), tree(options) {
    tree.resize(count);
    terms.add_random({0}, random);
    for (std::uint32_t i = 1; i < count; ++i) {
      terms.add_random({i - 1, i}, random);
      tree.refactor({i - 1, i}, {i}, terms);
      largest_update = std::max(largest_update, tree.last_poses());
    }
    std::vector<std::uint32_t> changed;
    tree.solve(0, changed);
  }

  Random random{5};
  LinearTerms terms;
  PoseTree tree;
  std::size_t largest_update = 0;
};

void check_edits(const PoseTree::Options& options, double accuracy) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Random random(seed);
    const auto count = static_cast<std::size_t>(random.integer(1, 40));
    LinearTerms terms(count);
    PoseTree tree(options);
    tree.resize(count);
    std::vector<std::uint32_t> changed;
    for (int round = 0; round < 60; ++round) {
      std::vector<std::uint32_t> touched;
      for (int i = random.integer(1, 4); i > 0; --i) {
        const auto by_edit = edit(terms, random);
        touched.insert(touched.end(), by_edit.begin(), by_edit.end());
      }
      std::vector<std::uint32_t> newest;
      if (random.uniform() < 0.5) newest.push_back(static_cast<std::uint32_t>(count) - 1);
      tree.refactor(touched, newest, terms);
      tree.solve(0, changed);
      REQUIRE(mismatch(tree, terms) < accuracy);
    }
    CHECK(tree.singular_cliques() == 0);
  }
}

TEST_CASE("pose tree: any sequence of edits solves what a dense solver solves") {
  PoseTree::Options options;
  options.narrow_from = 1000;  // more than there are
  SECTION("all factors in double precision") { check_edits(options, 1e-8); }
  SECTION("what cliques hand on, kept at some levels") {
    options.levels_kept = GENERATE(1, 2, 3);
    check_edits(options, 1e-8);
  }
  SECTION("factors in single precision") {
    options.narrow_from = 0;
    options.levels_kept = GENERATE(1, 3);
    check_edits(options, 1e-4);
  }
}

TEST_CASE("pose tree: single precision is of what is left alone, and covariances agree") {
  PoseTree::Options single;
  single.narrow_from = 0;
  Chain narrow(60, single);
  Chain wide(60);
  double worst = 0;
  for (const std::uint32_t pose : {0U, 20U, 59U}) {
    worst = std::max(worst, (narrow.tree.covariance(pose) - wide.tree.covariance(pose)).norm() /
                                wide.tree.covariance(pose).norm());
  }
  CHECK(worst < 1e-5);
  CHECK(worst > 1e-12);
  CHECK(mismatch(narrow.tree, narrow.terms) < 1e-5);
  CHECK(mismatch(wide.tree, wide.terms) < 1e-8);
}

TEST_CASE("pose tree: a pose that lost its terms keeps its delta, and may come back") {
  Random random(3);
  LinearTerms terms(3);
  PoseTree tree(PoseTree::Options{});
  tree.resize(3);
  terms.add_random({0, 1}, random);
  const std::uint32_t lost = terms.add_random({1, 2}, random);
  std::vector<std::uint32_t> changed;
  tree.refactor({0, 1, 2}, {}, terms);
  tree.solve(0, changed);
  const Vector6d before = tree.delta(2);
  REQUIRE(before.norm() > 1e-3);

  terms.remove(lost);
  tree.refactor({1, 2}, {}, terms);
  tree.solve(0, changed);
  CHECK(tree.delta(2) == before);
  CHECK(mismatch(tree, terms) < 1e-8);

  terms.add_random({2, 0}, random);
  tree.refactor({2, 0}, {2}, terms);
  tree.solve(0, changed);
  CHECK(mismatch(tree, terms) < 1e-8);
}

TEST_CASE("pose tree: an update on a chain touches its end alone") {
  Chain chain(500);
  CHECK(chain.largest_update <= 8);
  CHECK(mismatch(chain.tree, chain.terms) < 1e-8);
  // A loop over the whole chain touches what is between its ends, and is solved, too.
  std::vector<std::uint32_t> changed;
  chain.terms.add_random({0, 499}, chain.random);
  chain.tree.refactor({0, 499}, {}, chain.terms);
  chain.tree.solve(0, changed);
  CHECK(mismatch(chain.tree, chain.terms) < 1e-8);
  CHECK(chain.tree.clique_count() <= 500);
}

TEST_CASE("pose tree: the price of a change is that of the cliques up to the root") {
  Chain chain(100);
  std::vector<std::uint32_t> all(100);
  std::iota(all.begin(), all.end(), 0U);
  chain.tree.refactor(all, {}, chain.terms);
  std::vector<char> marked;
  CHECK(chain.tree.cost_of(all, marked) == Approx(chain.tree.last_cost()));
  CHECK(chain.tree.cost_of(all, marked) == 0);  // paid for
  CHECK(chain.tree.is_marked(all, marked));

  std::vector<char> end_only;
  const std::vector<std::uint32_t> end = {99};
  const std::vector<std::uint32_t> start = {0};
  const double price = chain.tree.cost_of(end, end_only);
  CHECK(price > 0);
  CHECK(price < 0.1 * chain.tree.last_cost());
  CHECK(chain.tree.is_marked(end, end_only));
  CHECK_FALSE(chain.tree.is_marked(start, end_only));
  CHECK(price + chain.tree.cost_of(start, end_only) + chain.tree.cost_of(all, end_only) ==
        Approx(chain.tree.last_cost()));
}

TEST_CASE("pose tree: back-substitution stops where nothing moves") {
  constexpr double kThreshold = 1e-4;
  Chain chain(300);
  const Tangents before = deltas(chain.tree, 300);
  for (int round = 0; round < 20; ++round) {
    chain.terms.add_random({298, 299}, chain.random);
    chain.tree.refactor({298, 299}, {}, chain.terms);
    std::vector<std::uint32_t> changed;
    chain.tree.solve(kThreshold, changed);
    CHECK(changed.size() < 100);
    CHECK(std::count(changed.begin(), changed.end(), 299U) == 1);
    const Tangents exact = chain.terms.dense_solution();
    CHECK((deltas(chain.tree, 300) - exact).cwiseAbs().maxCoeff() < 5 * kThreshold);
  }
  CHECK(deltas(chain.tree, 300).col(0) == before.col(0));  // not even looked at
}

TEST_CASE("pose tree: what changed is told, and small changes add up until they are") {
  LinearTerms terms(1);
  PoseTree tree(PoseTree::Options{});
  tree.resize(1);
  const Matrix6d hessian = Matrix6d::Identity();
  const Vector6d slope = Vector6d::Constant(-0.4);
  for (int round = 1; round <= 6; ++round) {
    terms.add({0}, round == 1 ? hessian : Matrix6d(Matrix6d::Zero()), slope);
    tree.refactor({0}, {}, terms);
    std::vector<std::uint32_t> changed;
    tree.solve(1, changed);
    CHECK(tree.delta(0)[0] == Approx(0.4 * round));
    CHECK(changed.size() == (round == 3 || round == 6 ? 1U : 0U));
  }
}

TEST_CASE("pose tree: a pose that nothing holds does not move, and does not harm") {
  Random random(8);
  LinearTerms terms(3);
  PoseTree tree(PoseTree::Options{});
  tree.resize(3);
  terms.add_random({0, 1}, random);
  const Tangents exact = terms.dense_solution();
  terms.add({1, 2}, Eigen::MatrixXd::Zero(12, 12), Eigen::VectorXd::Zero(12));
  std::vector<std::uint32_t> changed;
  tree.refactor({0, 1, 2}, {}, terms);
  tree.solve(0, changed);
  CHECK(tree.singular_cliques() > 0);
  CHECK(tree.delta(2).norm() == 0);
  CHECK((deltas(tree, 2) - exact.leftCols(2)).norm() < 1e-6 * exact.norm());
}

TEST_CASE("pose tree: numbers that are none are a bug, not an endless loop") {
  LinearTerms terms(1);
  PoseTree tree(PoseTree::Options{});
  tree.resize(1);
  terms.add({0}, Matrix6d::Constant(std::numeric_limits<double>::quiet_NaN()), Vector6d::Zero());
  CHECK_THROWS_AS(tree.refactor({0}, {}, terms), std::logic_error);
}

}  // namespace
}  // namespace hybrid_slam
