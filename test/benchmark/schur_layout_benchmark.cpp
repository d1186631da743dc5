// Which shape of residual blocks is fastest in Ceres' dense Schur solver? A window of 20 keyframes
// and 2000 landmarks, 10 iterations, one thread, landmarks eliminated first.
//
// Ceres 2.1 has its elimination compiled for some sizes only, <2,3,6> (rows, landmark, pose) among
// them but not <3,3,6>; any other size, and any mix of row counts, takes the dynamic path.
//
// And which BLAS? Run solve_map with LD_LIBRARY_PATH=$L/blas:$L/lapack (reference) and with
// $L/openblas-serial, L=/usr/lib/x86_64-linux-gnu. Results: docs/adding_a_factor.md.

#include <algorithm>
#include <memory>
#include <vector>

#include <benchmark/benchmark.h>
#include <ceres/ceres.h>

#include "factors/make_reprojection_factor.h"
#include "factors/manifolds.h"
#include "factors/reprojection_factor.h"
#include "test/support/random.h"
#include "test/support/synthetic_scene.h"

namespace hybrid_slam {
namespace {

enum Layout {
  kThreeRows,      // (u_left, v, u_right)
  kTwoAndOneRows,  // (u_left, v) and (u_right)
  kTwoTwoRows,     // (u_left, v / sqrt 2) and (u_right, v / sqrt 2): the same cost
  kMixed,          // every second observation mono, the others three rows
  kMixedTwoRows,   // the same, stereo as two blocks of two rows
  kThreeRowsJets,  // three rows, plain ceres::AutoDiffCostFunction
};
const char* const kLayoutNames[] = {"3 rows",     "2 + 1 rows",     "2 + 2 rows",
                                    "3, 2 mixed", "2 + 2, 2 mixed", "3 rows, jets"};

// Right camera's pixel (u_right, v): a pinhole at the end of the baseline.
struct RightOfStereo {
  static constexpr std::string_view kName = "right_of_stereo";
  static constexpr int kMeasurementDim = 2;
  static constexpr int kParamCount = 5;
  static double focal_length(const double* params) { return params[0]; }

  template <typename T>
  static bool project(const T* params, const T* p, T* pixel) {
    const T moved[3] = {p[0] - params[4], p[1], p[2]};
    return Pinhole::project(params, moved, pixel);
  }
  static bool project_with_jacobians(const double* params, const double* p, double* pixel,
                                     double* d_point, double*) {
    const double moved[3] = {p[0] - params[4], p[1], p[2]};
    return Pinhole::project_with_jacobians(params, moved, pixel, d_point, nullptr);
  }
  static bool unproject(const double*, const double*, double*) { return false; }
};

// u_right alone.
struct RightColumn {
  static constexpr std::string_view kName = "right_column";
  static constexpr int kMeasurementDim = 1;
  static constexpr int kParamCount = 5;
  static double focal_length(const double* params) { return params[0]; }

  template <typename T>
  static bool project(const T* params, const T* p, T* u_right) {
    if (!(p[2] > T(kMinDepth))) return false;
    u_right[0] = params[0] * (p[0] - params[4]) / p[2] + params[2];
    return true;
  }
  static bool project_with_jacobians(const double* params, const double* p, double* u_right,
                                     double* d_point, double*) {
    if (!project(params, p, u_right)) return false;
    d_point[0] = params[0] / p[2];
    d_point[1] = 0;
    d_point[2] = -d_point[0] * (p[0] - params[4]) / p[2];
    return true;
  }
  static bool unproject(const double*, const double*, double*) { return false; }
};

// The stereo residual as one writes it without derivatives at hand.
struct JetsFunctor {
  template <typename T>
  bool operator()(const T* pose, const T* point, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> rotation(pose);
    const Eigen::Matrix<T, 3, 1> p = rotation * Eigen::Map<const Eigen::Matrix<T, 3, 1>>(point) +
                                     Eigen::Map<const Eigen::Matrix<T, 3, 1>>(pose + 4);
    T params_as_t[5];
    for (int i = 0; i < 5; ++i) params_as_t[i] = T(params[static_cast<std::size_t>(i)]);
    if (!RectifiedStereo::project(params_as_t, p.data(), residual)) return false;
    for (int i = 0; i < 3; ++i) residual[i] = (residual[i] - T(measurement[i])) * T(1 / sigma);
    return true;
  }
  std::array<double, 5> params;
  Eigen::Vector3d measurement;
  double sigma;
};

// The factor by a 6-d delta of a pose kept elsewhere: what evaluation costs without a manifold.
class TangentFactor final : public ceres::SizedCostFunction<3, 6, 3> {
 public:
  TangentFactor(const std::array<double, 5>& params, const Rigid3d& pose,
                const Eigen::Vector3d& measurement, double sigma)
      : params_(params), pose_(pose), measurement_(measurement), inverse_sigma_(1 / sigma) {}
  bool Evaluate(const double* const* blocks, double* residual, double** jacobians) const override {
    return reprojection_residual<RectifiedStereo>(
        params_.data(), pose_.params.data(), blocks[1], measurement_.data(), inverse_sigma_,
        residual, jacobians == nullptr ? nullptr : jacobians[0],
        jacobians == nullptr ? nullptr : jacobians[1], nullptr);
  }

 private:
  std::array<double, 5> params_;
  const Rigid3d& pose_;
  Eigen::Vector3d measurement_;
  double inverse_sigma_;
};

struct Observation {
  std::size_t frame;
  std::size_t landmark;
  Eigen::Vector3d measurement;
  double sigma;
};

struct Window {
  std::array<double, 5> params;
  std::vector<Rigid3d> poses;
  std::vector<Eigen::Vector3d> points;
  std::vector<Observation> observations;
};

Window make_window(int keyframes, int landmarks) {
  SyntheticSceneOptions options;
  options.times = keyframes;
  options.step = 0.2;
  options.landmarks = landmarks;
  options.missing_right_rate = 0;
  const SyntheticScene scene = make_synthetic_scene(options);
  Random random(1);
  Window window;
  window.params = std::get<Calibrated<RectifiedStereo>>(scene.cameras[0]).params;
  for (const Eigen::Vector3d& point : scene.points_in_world) {
    window.points.push_back(point + random.vector(3, 0.05));
  }
  for (std::size_t f = 0; f < scene.frames.size(); ++f) {
    const SyntheticFrame& frame = scene.frames[f];
    window.poses.push_back(f < 2 ? frame.cam_from_world
                                 : random.rigid(0.03, 0.01) * frame.cam_from_world);
    for (std::size_t i = 0; i < frame.observations->size(); ++i) {
      if (!frame.observations->has_right(i)) continue;
      const Keypoint& keypoint = frame.observations->features.keypoints[i];
      window.observations.push_back({f,
                                     static_cast<std::size_t>(frame.landmark[i]),
                                     {keypoint.x, keypoint.y, frame.observations->u_right[i]},
                                     keypoint.sigma});
    }
  }
  return window;
}

template <typename M, std::size_t kCount>
ceres::CostFunction* factor(const std::array<double, kCount>& params, const Eigen::Vector3d& z,
                            double sigma) {
  return new ReprojectionFactor<M>(params, z.data(), sigma);
}

void add_two_two_rows(const Observation& o, const Window& window, ceres::LossFunction* loss,
                      double* pose, double* point, ceres::Problem* problem) {
  const double root = std::sqrt(0.5);  // scales v and its projection in each half
  std::array<double, 5> p = window.params;
  p[1] *= root;
  p[3] *= root;
  const std::array<double, 4> left = {p[0], p[1], p[2], p[3]};
  const double v = root * o.measurement[1];
  problem->AddResidualBlock(factor<Pinhole>(left, {o.measurement[0], v, 0}, o.sigma), loss, pose,
                            point);
  problem->AddResidualBlock(factor<RightOfStereo>(p, {o.measurement[2], v, 0}, o.sigma), loss, pose,
                            point);
}

void add_observation(const Observation& o, bool is_mono, Layout layout, Window* window,
                     ceres::LossFunction* loss, ceres::Problem* problem) {
  double* pose = window->poses[o.frame].params.data();
  double* point = window->points[o.landmark].data();
  const std::array<double, 5>& p = window->params;
  const std::array<double, 4> pinhole = {p[0], p[1], p[2], p[3]};
  if (is_mono || layout == kTwoAndOneRows) {
    problem->AddResidualBlock(factor<Pinhole>(pinhole, o.measurement, o.sigma), loss, pose, point);
    if (is_mono) return;
    const Eigen::Vector3d right(o.measurement[2], 0, 0);
    problem->AddResidualBlock(factor<RightColumn>(p, right, o.sigma), loss, pose, point);
  } else if (layout == kTwoTwoRows || layout == kMixedTwoRows) {
    add_two_two_rows(o, *window, loss, pose, point, problem);
  } else if (layout == kThreeRowsJets) {
    problem->AddResidualBlock(new ceres::AutoDiffCostFunction<JetsFunctor, 3, 7, 3>(
                                  new JetsFunctor{p, o.measurement, o.sigma}),
                              loss, pose, point);
  } else {
    problem->AddResidualBlock(factor<RectifiedStereo>(p, o.measurement, o.sigma), loss, pose,
                              point);
  }
}

void add_observations(Layout layout, Window* window, ceres::LossFunction* loss,
                      ceres::ParameterBlockOrdering* ordering, ceres::Problem* problem) {
  std::vector<char> seen(window->points.size(), 0);
  const bool mixed = layout == kMixed || layout == kMixedTwoRows;
  for (std::size_t i = 0; i < window->observations.size(); ++i) {
    const Observation& o = window->observations[i];
    add_observation(o, mixed && i % 2 == 0, layout, window, loss, problem);
    seen[o.landmark] = 1;
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (seen[i] != 0) ordering->AddElementToGroup(window->points[i].data(), 0);
  }
}

ceres::Solver::Summary solve(Window window, Layout layout, ceres::Solver::Options options) {
  ceres::HuberLoss loss(std::sqrt(7.815));
  PoseManifold tangent;
  ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>> plain;
  ceres::Manifold* manifold = &tangent;
  if (layout == kThreeRowsJets) manifold = &plain;
  ceres::Problem::Options problem_options;
  problem_options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
  for (std::size_t i = 0; i < window.poses.size(); ++i) {
    double* pose = window.poses[i].params.data();
    problem.AddParameterBlock(pose, 7, manifold);
    if (i < 2) problem.SetParameterBlockConstant(pose);
    ordering->AddElementToGroup(pose, 1);
  }
  add_observations(layout, &window, &loss, ordering.get(), &problem);
  options.linear_solver_ordering = ordering;
  options.max_num_iterations = 10;
  options.function_tolerance = 0;
  options.gradient_tolerance = 0;
  options.parameter_tolerance = 0;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary;
}

// Counters are of the shortest iteration: what other programs on the machine disturb least.
void run(benchmark::State& state, const Window& start, Layout layout,
         const ceres::Solver::Options& options) {
  double iteration = 1e9;
  double linear = 1e9;
  double preprocess = 1e9;
  double cost = 0;
  for (auto _ : state) {
    const ceres::Solver::Summary summary = solve(start, layout, options);
    if (!summary.IsSolutionUsable()) state.SkipWithError("the solve failed");
    for (std::size_t i = 1; i < summary.iterations.size(); ++i) {
      if (!summary.iterations[i].step_is_successful) continue;
      iteration = std::min(iteration, summary.iterations[i].iteration_time_in_seconds);
      linear = std::min(linear, summary.iterations[i].step_solver_time_in_seconds);
    }
    preprocess = std::min(preprocess, summary.preprocessor_time_in_seconds);
    cost = summary.final_cost;
  }
  state.counters["iteration_ms"] = 1e3 * iteration;
  state.counters["linear_ms"] = 1e3 * linear;
  state.counters["preprocess_ms"] = 1e3 * preprocess;
  state.counters["cost"] = cost;
  state.counters["observations"] = static_cast<double>(start.observations.size());
}

void solve_window(benchmark::State& state) {
  const auto layout = static_cast<Layout>(state.range(0));
  static const Window start = make_window(20, 2000);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  run(state, start, layout, options);
  state.SetLabel(kLayoutNames[layout]);
}

// Where the BLAS tells: 150 keyframes, a reduced system of 900 unknowns.
void solve_map(benchmark::State& state) {
  static const Window start = make_window(150, 4000);
  ceres::Solver::Options options;
  options.linear_solver_type = state.range(0) == 2 ? ceres::SPARSE_SCHUR : ceres::DENSE_SCHUR;
  options.dense_linear_algebra_library_type = state.range(0) == 1 ? ceres::LAPACK : ceres::EIGEN;
  options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  run(state, start, kThreeRows, options);
  const char* const labels[] = {"dense, Eigen", "dense, LAPACK", "sparse, CHOLMOD"};
  state.SetLabel(labels[state.range(0)]);
}

// What Ceres spends on [J6 | 0] times the lift: one evaluation of all Jacobians with 7-d blocks on
// the manifold, and with 6-d blocks that need none.
void evaluate_window(benchmark::State& state) {
  const bool with_manifold = state.range(0) != 0;
  Window window = make_window(20, 2000);
  PoseManifold manifold;
  ceres::Problem::Options problem_options;
  problem_options.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  ceres::Problem problem(problem_options);
  std::vector<Vector6d> deltas(window.poses.size(), Vector6d::Zero());
  for (Rigid3d& pose : window.poses) {
    if (with_manifold) problem.AddParameterBlock(pose.params.data(), 7, &manifold);
  }
  for (const Observation& o : window.observations) {
    double* point = window.points[o.landmark].data();
    if (with_manifold) {
      problem.AddResidualBlock(factor<RectifiedStereo>(window.params, o.measurement, o.sigma),
                               nullptr, window.poses[o.frame].params.data(), point);
    } else {
      problem.AddResidualBlock(
          new TangentFactor(window.params, window.poses[o.frame], o.measurement, o.sigma), nullptr,
          deltas[o.frame].data(), point);
    }
  }
  double cost = 0;
  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  const ceres::Problem::EvaluateOptions options;
  for (auto _ : state) {
    problem.Evaluate(options, &cost, &residuals, nullptr, &jacobian);
    benchmark::DoNotOptimize(jacobian.values.data());
  }
  state.SetLabel(with_manifold ? "[J6 | 0] and lift" : "J6");
}

BENCHMARK(solve_window)->DenseRange(kThreeRows, kThreeRowsJets)->Unit(benchmark::kMillisecond);
BENCHMARK(solve_map)->DenseRange(0, 2)->Unit(benchmark::kMillisecond);
BENCHMARK(evaluate_window)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace hybrid_slam
