#include "frontend/pose/rigid_alignment.h"

#include <limits>
#include <vector>

#include <catch2/catch.hpp>

#include "test/frontend/pose/pose_scene.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

using Points = std::vector<Eigen::Vector3d>;

template <typename Transform>
Points moved_by(const Transform& b_from_a, const Points& points) {
  Points moved;
  for (const Eigen::Vector3d& p : points) moved.push_back(b_from_a * p);
  return moved;
}

Points random_points(int count, Random& random) {
  Points points;
  for (int i = 0; i < count; ++i) points.push_back(random.vector(3, 5));
  return points;
}

double squared_distance(const Rigid3d& b_from_a, const Points& a, const Points& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (b_from_a * a[i] - b[i]).squaredNorm();
  return sum;
}

TEST_CASE("alignment recovers a rigid transform", "[pose]") {
  Random random(1);
  for (const int count : {3, 4, 100}) {
    for (int trial = 0; trial < 20; ++trial) {
      const Rigid3d truth = random.rigid(50, 3.14);
      const Points a = random_points(count, random);
      const auto found = align_rigid(a, moved_by(truth, a));
      REQUIRE(found);
      CHECK(pose_scene::rotation_error(*found, truth) < 1e-7);
      CHECK((found->translation() - truth.translation()).norm() < 1e-9);
    }
  }
}

TEST_CASE("alignment recovers a similarity", "[pose]") {
  Random random(2);
  for (const double scale : {0.01, 1.0, 37.0}) {
    const Rigid3d rigid = random.rigid(50, 3.14);
    const Sim3d truth(Eigen::Quaterniond(rigid.rotation()), rigid.translation(), scale);
    const Points a = random_points(20, random);
    const auto found = align_similarity(a, moved_by(truth, a));
    REQUIRE(found);
    CHECK(found->scale() == Approx(scale).epsilon(1e-12));
    for (const Eigen::Vector3d& p : a) CHECK((*found * p - truth * p).norm() < 1e-9);
  }
}

TEST_CASE("alignment of points in a plane does not mirror them", "[pose]") {
  Random random(3);
  for (int trial = 0; trial < 20; ++trial) {
    const Rigid3d truth = random.rigid(5, 3.14);
    Points a = random_points(10, random);
    for (Eigen::Vector3d& p : a) p.z() = 0;
    const auto found = align_rigid(a, moved_by(truth, a));
    REQUIRE(found);
    CHECK(pose_scene::rotation_error(*found, truth) < 1e-7);
  }
}

TEST_CASE("alignment of a mirrored set is still a rotation", "[pose]") {
  Random random(4);
  const Points a = random_points(30, random);
  Points b = a;
  for (Eigen::Vector3d& p : b) p.x() = -p.x();
  const auto found = align_similarity(a, b);
  REQUIRE(found);
  CHECK(found->rotation().toRotationMatrix().determinant() == Approx(1));
  CHECK(found->scale() < 1);
}

TEST_CASE("alignment is the least-squares one under noise", "[pose]") {
  Random random(5);
  const Rigid3d truth = random.rigid(5, 3.14);
  const Points a = random_points(50, random);
  Points b = moved_by(truth, a);
  for (Eigen::Vector3d& p : b) p += 0.05 * random.direction();
  const auto found = align_rigid(a, b);
  REQUIRE(found);
  const double at_solution = squared_distance(*found, a, b);
  for (int trial = 0; trial < 100; ++trial) {
    CHECK(squared_distance(random.rigid(1e-3, 1e-3) * *found, a, b) > at_solution);
  }
  CHECK(pose_scene::rotation_error(*found, truth) < 0.01);
}

TEST_CASE("alignment works far from the origin and along a path that is nearly straight",
          "[pose]") {
  Random random(6);
  const Rigid3d truth = random.rigid(1e5, 3.14);
  Points a;
  for (int i = 0; i < 60; ++i) {
    a.push_back({1e5 + 0.01 * random.gaussian(), 0.01 * random.gaussian(), static_cast<double>(i)});
  }
  const auto found = align_rigid(a, moved_by(truth, a));
  REQUIRE(found);
  for (const Eigen::Vector3d& p : a) CHECK((*found * p - truth * p).norm() < 1e-6);
}

TEST_CASE("points on a line are aligned where that is asked for", "[pose]") {
  Random random(8);
  Points line;
  for (int i = 0; i < 20; ++i) line.push_back(0.3 * i * Eigen::Vector3d(1, -2, 0.5));
  const Rigid3d rigid = random.rigid(50, 3.14);
  const auto found = align_rigid(line, moved_by(rigid, line), CollinearPoints::kAlign);
  REQUIRE(found);
  const Sim3d similar(rigid.rotation(), rigid.translation(), 2.5);
  const auto scaled = align_similarity(line, moved_by(similar, line), CollinearPoints::kAlign);
  REQUIRE(scaled);
  CHECK(scaled->scale() == Approx(2.5));
  for (const Eigen::Vector3d& p : line) {
    CHECK((*found * p - rigid * p).norm() < 1e-9);
    CHECK((*scaled * p - similar * p).norm() < 1e-9);
  }
}

TEST_CASE("alignment refuses what leaves the rotation open", "[pose]") {
  const Points line = {{0, 0, 0}, {1, 2, 3}, {2, 4, 6}, {-5, -10, -15}};
  CHECK_FALSE(align_rigid(line, line));
  CHECK_FALSE(align_similarity(line, line));
  const Points one_place(5, Eigen::Vector3d(1, 2, 3));
  CHECK_FALSE(align_rigid(one_place, one_place));
  CHECK_FALSE(align_rigid(Points(line.begin(), line.begin() + 2), Points(2, line[0])));
  CHECK_FALSE(align_rigid({}, {}));
  Random random(7);
  Points a = random_points(5, random);
  const Points b = a;
  a[2].y() = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(align_rigid(a, b));
  CHECK_FALSE(align_similarity(b, one_place));
  CHECK_THROWS_AS(align_rigid(b, line), std::invalid_argument);
}

}  // namespace
}  // namespace hybrid_slam
