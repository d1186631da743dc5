#include "backend/incremental/landmark_term.h"

#include "backend/incremental/condensed_term.h"
#include "backend/incremental/front.h"
#include "backend/incremental/world_tangent.h"
#include "test/support/random.h"

#include <algorithm>
#include <numeric>
#include <span>

#include <catch2/catch.hpp>

#include <Eigen/Dense>

namespace hybrid_slam {
namespace {

// A view with random derivatives, of two or three rows.
LandmarkView random_view(std::uint32_t pose, int rows, Random& random) {
  LandmarkView view;
  view.pose = pose;
  view.usable = true;
  for (int row = 0; row < rows; ++row) {
    view.by_pose.row(row) = random.vector(6, 100).transpose();
    view.by_point.row(row) = random.vector(3, 100).transpose();
    view.residual[row] = random.uniform(-2, 2);
  }
  return view;
}

// As a known pose has it.
LandmarkView fixed_view(int rows, Random& random) {
  LandmarkView view = random_view(0, rows, random);
  view.fixed = true;
  view.by_pose.setZero();
  return view;
}

struct DenseSchur {
  Eigen::MatrixXd hessian;   // of the poses, the point eliminated
  Eigen::VectorXd gradient;  // likewise
  Eigen::Vector3d point_at(const Eigen::VectorXd& delta) const {
    return -information.llt().solve(point_gradient + cross.transpose() * delta);
  }
  Eigen::MatrixXd cross;
  Eigen::Matrix3d information;
  Eigen::Vector3d point_gradient;
};

// From the stacked system, in the poses 0 .. poses - 1 and the point.
DenseSchur dense_schur(const LandmarkTerm& term, std::uint32_t poses) {
  const auto rows = static_cast<Eigen::Index>(3 * term.views.size());
  Eigen::MatrixXd by_poses = Eigen::MatrixXd::Zero(rows, 6 * poses);
  Eigen::MatrixXd by_point = Eigen::MatrixXd::Zero(rows, 3);
  Eigen::VectorXd residual = Eigen::VectorXd::Zero(rows);
  for (std::size_t i = 0; i < term.views.size(); ++i) {
    const LandmarkView& view = term.views[i];
    const auto row = static_cast<Eigen::Index>(3 * i);
    if (!view.usable) continue;
    if (!view.fixed) by_poses.block<3, 6>(row, 6 * view.pose) = view.by_pose;
    by_point.middleRows<3>(row) = view.by_point;
    residual.segment<3>(row) = view.residual;
  }
  DenseSchur schur;
  schur.cross = by_poses.transpose() * by_point;
  schur.information = by_point.transpose() * by_point;
  schur.point_gradient = by_point.transpose() * residual;
  const Eigen::MatrixXd gain = schur.cross * schur.information.inverse();
  schur.hessian = by_poses.transpose() * by_poses - gain * schur.cross.transpose();
  schur.gradient = by_poses.transpose() * residual - gain * schur.point_gradient;
  return schur;
}

// What the term adds to a front over the poses 0 .. poses - 1 in an order turned around, brought
// back to their own; symmetric.
struct Assembled {
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
};

template <typename Term>
Assembled assemble(const Term& term, std::uint32_t poses) {
  std::vector<std::uint32_t> slot_of(poses);
  for (std::uint32_t i = 0; i < poses; ++i) slot_of[i] = poses - 1 - i;
  Front front(poses, slot_of);
  term.assemble(front);
  const Eigen::Index size = 6 * poses;
  const Eigen::MatrixXd full = front.matrix().topRows(size).selfadjointView<Eigen::Lower>();
  Assembled result{Eigen::MatrixXd(size, size), Eigen::VectorXd(size)};
  for (std::uint32_t i = 0; i < poses; ++i) {
    result.gradient.segment<6>(6 * i) =
        front.matrix().row(size).segment<6>(6 * slot_of[i]).transpose();
    for (std::uint32_t j = 0; j < poses; ++j) {
      result.hessian.block<6, 6>(6 * i, 6 * j) = full.block<6, 6>(6 * slot_of[i], 6 * slot_of[j]);
    }
  }
  return result;
}

void check_against_dense(LandmarkTerm& term, std::uint32_t poses, Random& random) {
  term.eliminate();
  REQUIRE(term.solvable);
  const DenseSchur expected = dense_schur(term, poses);
  const Assembled actual = assemble(term, poses);
  const double size = 1e4 * static_cast<double>(term.views.size());  // of what is subtracted
  CHECK((actual.hessian - expected.hessian).cwiseAbs().maxCoeff() < 1e-9 * size);
  CHECK((actual.gradient - expected.gradient).cwiseAbs().maxCoeff() < 1e-9 * size);

  const Eigen::VectorXd delta = random.vector(static_cast<int>(6 * poses), 0.1);
  const Eigen::Vector3d displacement =
      term.displacement([&](std::uint32_t pose) -> Vector6d { return delta.segment<6>(6 * pose); });
  CHECK((displacement - expected.point_at(delta)).norm() < 1e-9);
}

TEST_CASE("landmark term: elimination is the Schur complement of the stacked system") {
  Random random(1);
  for (int trial = 0; trial < 50; ++trial) {
    LandmarkTerm term;
    term.base = random.vector(3, 10);
    const int poses = random.integer(2, 6);
    for (int pose = 0; pose < poses; ++pose) {
      term.views.push_back(
          random_view(static_cast<std::uint32_t>(pose), random.integer(2, 3), random));
    }
    if (trial % 3 == 0) term.views.push_back(fixed_view(random.integer(2, 3), random));
    if (trial % 4 == 0) {  // does not project
      term.views[0].usable = false;
      term.views.push_back(random_view(1, 2, random));  // a second view of one pose
    }
    check_against_dense(term, static_cast<std::uint32_t>(poses), random);
  }
}

TEST_CASE("landmark term: beside a known pose, one view is enough to contribute") {
  Random random(2);
  for (const int rows : {2, 3}) {
    LandmarkTerm term;
    term.views = {random_view(0, rows, random), fixed_view(rows, random)};
    check_against_dense(term, 1, random);
    CHECK(assemble(term, 1).hessian.norm() > 1);
  }
}

TEST_CASE("landmark term: what a single view tells is used up by its point") {
  Random random(3);
  LandmarkTerm stereo;
  stereo.views = {random_view(0, 3, random)};
  stereo.eliminate();
  CHECK(stereo.solvable);  // the point follows its pose
  CHECK(assemble(stereo, 1).hessian.norm() == 0);
  CHECK(assemble(stereo, 1).gradient.norm() == 0);

  LandmarkTerm mono;
  mono.base = {1, 2, 3};
  mono.views = {random_view(0, 2, random)};
  mono.eliminate();
  CHECK_FALSE(mono.solvable);
  CHECK(assemble(mono, 1).hessian.norm() == 0);
  CHECK(mono.displacement([](std::uint32_t) { return Vector6d(Vector6d::Ones()); }).isZero(0));
}

TEST_CASE("landmark term: a point at unknown depth contributes nothing") {
  Random random(4);
  LandmarkTerm term;
  const LandmarkView first = random_view(0, 2, random);
  LandmarkView second = random_view(1, 2, random);
  second.by_point = 1.5 * first.by_point;  // parallel rays
  term.views = {first, second};
  term.eliminate();
  CHECK_FALSE(term.solvable);
  CHECK(assemble(term, 2).hessian.norm() == 0);
  CHECK(assemble(term, 2).gradient.norm() == 0);

  term.views.push_back(random_view(2, 2, random));  // from aside
  check_against_dense(term, 3, random);
}

// Sees a point from a pose whose tangent has this place: moving all together changes nothing.
LandmarkView view_of(const Eigen::Vector3d& point, std::uint32_t pose, const Eigen::Vector3d& place,
                     Random& random) {
  LandmarkView view = random_view(pose, 3, random);
  view.by_pose.leftCols<3>() = view.by_point;
  view.by_pose.rightCols<3>() = -view.by_point * hat(point - place);
  return view;
}

// Landmarks that some of the poses in a row see, each of them as many, and what they are condensed
// to.
struct CondensedRow {
  CondensedRow(std::size_t poses, std::size_t count, std::size_t seen_by) : landmarks(count) {
    for (std::size_t i = 0; i < poses; ++i) {
      places.emplace_back(static_cast<double>(i), random.uniform(-1, 1), 30 + random.uniform());
    }
    std::vector<const LandmarkTerm*> all;
    for (LandmarkTerm& landmark : landmarks) {
      const Eigen::Vector3d point = random.vector(3, 5);
      const int first = random.integer(0, static_cast<int>(poses - seen_by));
      for (std::uint32_t i = 0; i < seen_by; ++i) {
        const std::uint32_t pose = static_cast<std::uint32_t>(first) + i;
        landmark.views.push_back(view_of(point, pose, places[pose], random));
        landmark.poses.push_back(pose);
      }
      landmark.eliminate();
      all.push_back(&landmark);
    }
    std::vector<std::uint32_t> numbers(poses);
    std::iota(numbers.begin(), numbers.end(), 0U);
    const Eigen::VectorXd start = Eigen::VectorXd::Zero(rows());
    term.begin(numbers, start);
    term.add(all, std::vector<double>(count, 0), places, start);
  }

  Eigen::Index rows() const { return static_cast<Eigen::Index>(6 * places.size()); }

  Eigen::VectorXd common_motion() {
    const Vector6d xi = random.vector(6, 1);
    Eigen::VectorXd common(rows());
    for (std::size_t i = 0; i < places.size(); ++i) {
      common.segment<6>(static_cast<Eigen::Index>(6 * i)) = WorldTangent{places[i]}.increment(xi);
    }
    return common;
  }

  Random random{8};
  std::vector<Eigen::Vector3d> places;
  std::vector<LandmarkTerm> landmarks;
  CondensedTerm term;
};

// Many views by few poses are kept as blocks between these, few by many as they are.
CondensedRow many_or_few_views() {
  const bool many = GENERATE(true, false);
  CondensedRow made = many ? CondensedRow(6, 40, 4) : CondensedRow(24, 5, 20);
  REQUIRE(made.term.shared.empty() == !many);
  REQUIRE(made.term.reduced.empty() == many);
  return made;
}

TEST_CASE("condensed term: it is the sum of its landmarks' terms, to single precision") {
  const CondensedRow made = many_or_few_views();
  const auto poses = static_cast<std::uint32_t>(made.places.size());
  const Assembled whole = assemble(made.term, poses);
  Eigen::MatrixXd hessian = Eigen::MatrixXd::Zero(made.rows(), made.rows());
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(made.rows());
  for (const LandmarkTerm& landmark : made.landmarks) {
    const Assembled one = assemble(landmark, poses);
    hessian += one.hessian;
    gradient += one.gradient;
  }
  CHECK((whole.hessian - hessian).norm() < 1e-6 * hessian.norm());
  CHECK((whole.gradient - gradient).norm() < 1e-12 * gradient.norm());
  const Eigen::VectorXd v = Random(3).vector(static_cast<int>(made.rows()), 1);
  CHECK((made.term.times(v) - whole.hessian * v).norm() < 1e-12 * (whole.hessian * v).norm());
}

TEST_CASE("condensed term: what joins it later counts as if it had been there") {
  // As blocks, as views, and as views that become blocks.
  const std::size_t first = GENERATE(20, 2, 1);
  CondensedRow made = first == 2 ? CondensedRow(24, 5, 20) : CondensedRow(8, 60, 4);
  const auto poses = static_cast<std::uint32_t>(made.places.size());
  const Eigen::VectorXd now = made.random.vector(static_cast<int>(made.rows()), 1e-3);
  const std::vector<std::uint32_t> all = made.term.poses;
  std::vector<const LandmarkTerm*> landmarks;
  std::vector<std::uint32_t> some;  // that the first landmarks have
  for (std::size_t k = 0; k < made.landmarks.size(); ++k) {
    landmarks.push_back(&made.landmarks[k]);
    if (k < first) {
      some.insert(some.end(), made.landmarks[k].poses.begin(), made.landmarks[k].poses.end());
    }
  }
  std::sort(some.begin(), some.end());
  some.erase(std::unique(some.begin(), some.end()), some.end());
  std::vector<Eigen::Vector3d> some_places;
  for (const std::uint32_t pose : some) some_places.push_back(made.places[pose]);
  const std::vector<double> costs(landmarks.size(), 7);
  const std::span<const LandmarkTerm* const> known = landmarks;
  const std::span<const double> their_costs = costs;

  CondensedTerm joined;
  const Eigen::VectorXd start = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(6 * some.size()));
  joined.begin(some, start);
  joined.add(known.first(first), their_costs.first(first), some_places, start);
  joined.widen(all, now, now);
  joined.add(known.subspan(first), their_costs.subspan(first), made.places, now);

  const Assembled expected = assemble(made.term, poses);
  const Assembled actual = assemble(joined, poses);
  CHECK((actual.hessian - expected.hessian).norm() < 1e-6 * expected.hessian.norm());
  CHECK((actual.gradient - expected.gradient).norm() < 1e-6 * expected.gradient.norm());
  CHECK(joined.squared_norm_at(now) == Approx(made.term.squared_norm_at(now)).epsilon(1e-5));
  CHECK(joined.rows == made.term.rows);
}

TEST_CASE("condensed term: in single precision it says nothing about a common motion") {
  CondensedRow made = many_or_few_views();
  const CondensedTerm& term = made.term;
  const Eigen::VectorXd common = made.common_motion();
  double size = 0;
  for (std::size_t i = 0; i < made.places.size(); ++i) {
    const auto own = common.segment<6>(static_cast<Eigen::Index>(6 * i));
    size += own.dot(term.own[i] * own);
  }
  CHECK(std::abs(common.dot(term.times(common))) < 1e-12 * size);
  CHECK(std::abs(made.common_motion().dot(term.times(common))) < 1e-12 * size);
  Eigen::VectorXd bent = common;
  bent.head<6>() += made.random.vector(6, 1);
  CHECK(bent.dot(term.times(bent)) > 1e-4 * size);
}

}  // namespace
}  // namespace hybrid_slam
