#include "backend/incremental/landmark_term.h"

#include "backend/incremental/condensed_term.h"
#include "backend/incremental/front.h"
#include "backend/incremental/world_tangent.h"
#include "test/support/random.h"

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

Assembled assemble(const LandmarkTerm& term, std::uint32_t poses) {
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

TEST_CASE("condensed term: in single precision it says nothing about a common motion") {
  Random random(8);
  std::vector<Eigen::Vector3d> places;
  for (int i = 0; i < 6; ++i) places.emplace_back(i, random.uniform(-1, 1), 30 + random.uniform());
  std::vector<LandmarkTerm> landmarks(40);
  std::vector<const LandmarkTerm*> all;
  std::vector<double> costs(landmarks.size(), 0);
  for (LandmarkTerm& landmark : landmarks) {
    const Eigen::Vector3d point = random.vector(3, 5);
    const int first = random.integer(0, 2);
    for (std::uint32_t i = 0; i < 4; ++i) {
      const std::uint32_t pose = static_cast<std::uint32_t>(first) + i;
      landmark.views.push_back(view_of(point, pose, places[pose], random));
    }
    landmark.eliminate();
    all.push_back(&landmark);
  }
  CondensedTerm term;
  term.begin({0, 1, 2, 3, 4, 5}, Eigen::VectorXd::Zero(36));
  term.add(all, costs, places);
  const auto common_motion = [&] {
    const Vector6d xi = random.vector(6, 1);
    Eigen::VectorXd common(36);
    for (std::size_t i = 0; i < places.size(); ++i) {
      common.segment<6>(static_cast<Eigen::Index>(6 * i)) = WorldTangent{places[i]}.increment(xi);
    }
    return common;
  };
  const Eigen::VectorXd common = common_motion();
  double size = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const auto own = common.segment<6>(static_cast<Eigen::Index>(6 * i));
    size += own.dot(term.own[i] * own);
  }
  CHECK(std::abs(common.dot(term.times(common))) < 1e-12 * size);
  CHECK(std::abs(common_motion().dot(term.times(common))) < 1e-12 * size);
  Eigen::VectorXd bent = common;
  bent.head<6>() += random.vector(6, 1);
  CHECK(bent.dot(term.times(bent)) > 1e-4 * size);
}

}  // namespace
}  // namespace hybrid_slam
