// Nanoseconds per projection and per reprojection factor, analytic Jacobians against jets of the
// same templated projection, in one run. Goal: analytic at least twice as fast.

#include <memory>
#include <vector>

#include <benchmark/benchmark.h>
#include <ceres/autodiff_cost_function.h>
#include <ceres/jet.h>
#include <ceres/rotation.h>

#include "factors/reprojection_factor.h"
#include "test/support/test_cameras.h"

namespace hybrid_slam {
namespace {

template <typename M>
void project_value(benchmark::State& state) {
  Random random(1);
  const auto points = test_points<M>(random);
  const auto params = TestCamera<M>::camera().params;
  double measurement[M::kMeasurementDim];
  for (auto _ : state) {
    for (const Eigen::Vector3d& point : points) {
      benchmark::DoNotOptimize(M::project(params.data(), point.data(), measurement));
      benchmark::DoNotOptimize(measurement);
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(points.size()));
}

template <typename M>
void unproject(benchmark::State& state) {
  Random random(1);
  const auto points = test_points<M>(random);
  const auto params = TestCamera<M>::camera().params;
  std::vector<std::array<double, 3>> measurements(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    M::project(params.data(), points[i].data(), measurements[i].data());
  }
  double bearing[3];
  for (auto _ : state) {
    for (const auto& measurement : measurements) {
      benchmark::DoNotOptimize(M::unproject(params.data(), measurement.data(), bearing));
      benchmark::DoNotOptimize(bearing);
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(points.size()));
}

// d measurement / d point.
template <typename M>
void project_analytic(benchmark::State& state) {
  Random random(1);
  const auto points = test_points<M>(random);
  const auto params = TestCamera<M>::camera().params;
  double measurement[M::kMeasurementDim];
  double jacobian[M::kMeasurementDim * 3];
  for (auto _ : state) {
    for (const Eigen::Vector3d& point : points) {
      benchmark::DoNotOptimize(
          M::project_with_jacobians(params.data(), point.data(), measurement, jacobian, nullptr));
      benchmark::DoNotOptimize(jacobian);
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(points.size()));
}

template <typename M>
void project_jets(benchmark::State& state) {
  using Jet = ceres::Jet<double, 3>;
  Random random(1);
  const auto points = test_points<M>(random);
  Jet params[M::kParamCount];
  for (int i = 0; i < M::kParamCount; ++i) {
    params[i] = Jet(TestCamera<M>::camera().params[static_cast<std::size_t>(i)]);
  }
  Jet measurement[M::kMeasurementDim];
  for (auto _ : state) {
    for (const Eigen::Vector3d& p : points) {
      const Jet point[3] = {Jet(p[0], 0), Jet(p[1], 1), Jet(p[2], 2)};
      benchmark::DoNotOptimize(M::project(params, point, measurement));
      benchmark::DoNotOptimize(measurement);
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(points.size()));
}

template <typename M>
struct JetsFunctor {
  template <typename T>
  bool operator()(const T* pose, const T* point, T* residual) const {
    const T wxyz[4] = {pose[3], pose[0], pose[1], pose[2]};
    T p[3];
    ceres::UnitQuaternionRotatePoint(wxyz, point, p);
    for (int i = 0; i < 3; ++i) p[i] += pose[4 + i];
    T params_as_t[M::kParamCount];
    for (std::size_t i = 0; i < params.size(); ++i) params_as_t[i] = T(params[i]);
    if (!M::project(params_as_t, p, residual)) return false;
    for (int i = 0; i < M::kMeasurementDim; ++i) {
      residual[i] = (residual[i] - T(measurement[i])) * T(inverse_sigma);
    }
    return true;
  }
  std::array<double, M::kParamCount> params;
  double measurement[3];
  double inverse_sigma;
};

// Residual and Jacobians by pose and point of many factors, as a solver calls them.
template <typename M>
void evaluate_factors(benchmark::State& state, bool with_jets) {
  Random random(1);
  const auto params = TestCamera<M>::camera().params;
  struct Item {
    std::unique_ptr<ceres::CostFunction> factor;
    Rigid3d pose;
    Eigen::Vector3d point;
  };
  std::vector<Item> items;
  for (const Eigen::Vector3d& point : test_points<M>(random)) {
    double z[3] = {1, 2, 3};
    Item item;
    if (with_jets) {
      item.factor =
          std::make_unique<ceres::AutoDiffCostFunction<JetsFunctor<M>, M::kMeasurementDim, 7, 3>>(
              new JetsFunctor<M>{params, {z[0], z[1], z[2]}, 0.5});
    } else {
      item.factor = std::make_unique<ReprojectionFactor<M>>(params, z, 2.0);
    }
    item.pose = random.rigid(3, 3);
    item.point = inverse(item.pose) * point;
    items.push_back(std::move(item));
  }
  double residual[3], d_pose[21], d_point[9];
  double* jacobians[2] = {d_pose, d_point};
  for (auto _ : state) {
    for (const Item& item : items) {
      const double* blocks[2] = {item.pose.params.data(), item.point.data()};
      benchmark::DoNotOptimize(item.factor->Evaluate(blocks, residual, jacobians));
      benchmark::DoNotOptimize(d_pose);
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(items.size()));
}

template <typename M>
void factor_analytic(benchmark::State& state) {
  evaluate_factors<M>(state, false);
}

template <typename M>
void factor_jets(benchmark::State& state) {
  evaluate_factors<M>(state, true);
}

#define FOR_EACH_MODEL(function)                 \
  BENCHMARK_TEMPLATE(function, Pinhole);         \
  BENCHMARK_TEMPLATE(function, RectifiedStereo); \
  BENCHMARK_TEMPLATE(function, KannalaBrandt)

FOR_EACH_MODEL(project_value);
FOR_EACH_MODEL(unproject);
FOR_EACH_MODEL(project_analytic);
FOR_EACH_MODEL(project_jets);
FOR_EACH_MODEL(factor_analytic);
FOR_EACH_MODEL(factor_jets);

}  // namespace
}  // namespace hybrid_slam
