#include "frontend/pose/damped_gauss_newton.h"

#include <cmath>
#include <limits>

#include <catch2/catch.hpp>

#include "test/support/allocation_watch.h"

namespace hybrid_slam {
namespace {

using Equations1 = NormalEquations<1>;
using Equations2 = NormalEquations<2>;
using Eigen::Vector2d;
using RowMatrix2d = Eigen::Matrix<double, 2, 2, Eigen::RowMajor>;

const auto plus = [](const Vector2d& step, const Vector2d& x) -> Vector2d { return x + step; };
const auto plus_one = [](const Equations1::Step& step, double x) { return x + step[0]; };

// r = A x - b.
Equations2 linear(const RowMatrix2d& a, const Vector2d& b, const Vector2d& x) {
  Equations2 equations;
  const Vector2d residual = a * x - b;
  equations.add<2>(a, residual, 1);
  equations.cost = residual.squaredNorm();
  return equations;
}

// r = atan(x): Gauss-Newton overshoots from |x| = 1.3917 on, farther with each step.
Equations1 arctangent(double x) {
  const double residual = std::atan(x);
  Equations1 equations;
  equations.add<1>(Eigen::Matrix<double, 1, 1>(1 / (1 + x * x)),
                   Eigen::Matrix<double, 1, 1>(residual), 1);
  equations.cost = residual * residual;
  return equations;
}

// Rosenbrock's valley, r = (10 (y - x^2), 1 - x): its floor is at (1, 1), with no cost.
Equations2 valley(const Vector2d& at) {
  RowMatrix2d jacobian;
  jacobian << -20 * at.x(), 10, -1, 0;
  const Vector2d residual(10 * (at.y() - at.x() * at.x()), 1 - at.x());
  Equations2 equations;
  equations.add<2>(jacobian, residual, 1);
  equations.cost = residual.squaredNorm();
  return equations;
}

TEST_CASE("A quadratic is minimised by one step", "[pose]") {
  RowMatrix2d a;
  a << 2, 1, -1, 3;
  const Vector2d truth(0.7, -4);
  int evaluations = 0;
  const auto minimum = damped_gauss_newton<2>(Vector2d(100, -1000),
                                              [&](const Vector2d& x) {
                                                ++evaluations;
                                                return std::optional(linear(a, a * truth, x));
                                              },
                                              plus, {10, 1e-9});
  REQUIRE(minimum);
  CHECK(minimum->converged);
  CHECK((minimum->state - truth).norm() < 1e-12);
  CHECK(evaluations == 2);  // at the start and at the minimum
}

TEST_CASE("The sums are those of least squares", "[pose]") {
  RowMatrix2d a;
  a << 2, 1, -1, 3;
  const Vector2d residual(0.5, -2);
  Equations2 equations;
  equations.add<2>(a, residual, 3);
  equations.add<2>(a, residual, 0.5);
  CHECK((equations.full_information() - 3.5 * a.transpose() * a).norm() < 1e-12);
  CHECK((equations.gradient - 3.5 * a.transpose() * residual).norm() < 1e-12);
}

TEST_CASE("Where Gauss-Newton diverges, damping leads to the minimum", "[pose]") {
  double undamped = 3;
  for (int i = 0; i < 4; ++i) undamped += (*arctangent(undamped).solve(0))[0];
  CHECK(std::abs(undamped) > 1e6);

  const auto minimum = damped_gauss_newton<1>(
      3.0, [](double x) { return std::optional(arctangent(x)); }, plus_one, {50, 1e-9});
  REQUIRE(minimum);
  CHECK(minimum->converged);
  CHECK(std::abs(minimum->state) < 1e-12);

  // Without damping the first step is refused, and the start is all there is.
  const auto refused = damped_gauss_newton<1>(
      3.0, [](double x) { return std::optional(arctangent(x)); }, plus_one, {50, 1e-9, 0});
  REQUIRE(refused);
  CHECK_FALSE(refused->converged);
  CHECK(refused->state == 3);
}

TEST_CASE("A minimisation allocates nothing", "[pose]") {
  const AllocationWatch watch;
  const auto minimum = damped_gauss_newton<2>(
      Vector2d(-1.2, 1), [](const Vector2d& x) { return std::optional(valley(x)); }, plus,
      {200, 1e-10});
  const std::size_t largest = watch.largest();
  CHECK(minimum);
  CHECK(largest == 0);
}

TEST_CASE("No step that is taken raises the cost", "[pose]") {
  double last = std::numeric_limits<double>::infinity();
  bool descends = true;
  const auto minimum = damped_gauss_newton<2>(
      Vector2d(-1.2, 1), [](const Vector2d& x) { return std::optional(valley(x)); },
      [&](const Vector2d& step, const Vector2d& x) -> Vector2d {
        const double cost = valley(x).cost;  // steps begin where the last one that was taken ended
        descends = descends && cost <= last * (1 + 1e-12);
        last = cost;
        return x + step;
      },
      {200, 1e-10});
  REQUIRE(minimum);
  CHECK(minimum->converged);
  CHECK(descends);
  CHECK((minimum->state - Vector2d(1, 1)).norm() < 1e-10);
}

TEST_CASE("What the residuals leave open stays where it is", "[pose]") {
  // x + y is measured, their difference is not.
  RowMatrix2d a;
  a << 1, 1, 2, 2;
  const auto minimum = damped_gauss_newton<2>(Vector2d(5, 1),
                                              [&](const Vector2d& x) {
                                                return std::optional(linear(a, {2, 4}, x));
                                              },
                                              plus, {50, 1e-9});
  REQUIRE(minimum);
  CHECK(minimum->state.allFinite());
  CHECK(minimum->state.sum() == Approx(2).margin(1e-9));
  CHECK_FALSE(is_determined(minimum->equations.full_information()));

  // y is no part of the problem at all.
  a << 1, 0, 2, 0;
  const auto half = damped_gauss_newton<2>(Vector2d(5, 1),
                                           [&](const Vector2d& x) {
                                             return std::optional(linear(a, {2, 4}, x));
                                           },
                                           plus, {50, 1e-9});
  REQUIRE(half);
  CHECK(half->converged);
  CHECK((half->state - Vector2d(2, 1)).norm() < 1e-12);
  CHECK_FALSE(is_determined(half->equations.full_information()));
}

TEST_CASE("A step to where there is no cost is refused", "[pose]") {
  // r = log(x) has its zero at 1; the full step from 5 leads to 5 - 5 log 5 < 0.
  const auto logarithm = [](double x) -> std::optional<Equations1> {
    if (!(x > 0)) return std::nullopt;
    Equations1 equations;
    const double residual = std::log(x);
    equations.add<1>(Eigen::Matrix<double, 1, 1>(1 / x), Eigen::Matrix<double, 1, 1>(residual), 1);
    equations.cost = residual * residual;
    return equations;
  };
  const auto minimum = damped_gauss_newton<1>(5.0, logarithm, plus_one, {50, 1e-9});
  REQUIRE(minimum);
  CHECK(minimum->converged);
  CHECK(minimum->state == Approx(1).epsilon(1e-12));
  CHECK_FALSE(damped_gauss_newton<1>(-1.0, logarithm, plus_one, {50, 1e-9}));
}

TEST_CASE("It ends after the steps it was given, with the best state", "[pose]") {
  int evaluations = 0;
  const auto minimum = damped_gauss_newton<2>(Vector2d(-1.2, 1),
                                              [&](const Vector2d& x) {
                                                ++evaluations;
                                                return std::optional(valley(x));
                                              },
                                              plus, {3, 1e-10});
  REQUIRE(minimum);
  CHECK_FALSE(minimum->converged);
  CHECK(evaluations == 4);
  CHECK(minimum->equations.cost == valley(minimum->state).cost);
  CHECK(minimum->equations.cost <= valley(Vector2d(-1.2, 1)).cost);
}

TEST_CASE("Numbers that are not finite end it", "[pose]") {
  const auto none = std::numeric_limits<double>::quiet_NaN();
  const auto with = [](double cost, double gradient) {
    return [=](double) {
      Equations1 equations;
      equations.cost = cost;
      equations.gradient[0] = gradient;
      equations.information(0, 0) = 1;
      return std::optional(equations);
    };
  };
  CHECK_FALSE(damped_gauss_newton<1>(2.0, with(none, 1), plus_one, {50, 1e-9}));
  // No step can be found, and the start is returned.
  const auto stuck = damped_gauss_newton<1>(2.0, with(1, none), plus_one, {50, 1e-9});
  REQUIRE(stuck);
  CHECK_FALSE(stuck->converged);
  CHECK(stuck->state == 2);
  // A cost that rises whatever the step: the derivative is wrong. Damped steps get short, which
  // is no minimum.
  const auto wrong = damped_gauss_newton<1>(2.0,
                                            [](double x) {
                                              Equations1 equations;
                                              equations.cost = x * x;
                                              equations.gradient[0] = -1;
                                              equations.information(0, 0) = 1;
                                              return std::optional(equations);
                                            },
                                            plus_one, {50, 1e-3});
  REQUIRE(wrong);
  CHECK_FALSE(wrong->converged);
  CHECK(wrong->state == 2);
}

}  // namespace
}  // namespace hybrid_slam
