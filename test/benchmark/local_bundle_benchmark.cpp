// Local bundle adjustment of a window of 20 keyframes x 2000 landmarks: ours against the same
// problem written in plain Ceres (automatic derivatives, quaternion and translation as two blocks),
// both from the map's values to the solution, 10 iterations, one thread.

#include <benchmark/benchmark.h>
#include <ceres/ceres.h>

#include "backend/problem/solve_bundle.h"
#include "cameras/geometry/se3.h"
#include "test/support/filled_map.h"
#include "test/support/random.h"

namespace hybrid_slam {
namespace {

constexpr int kIterations = 10;

struct Window {
  SyntheticScene scene;
  FilledMap filled;
};

const Window& window(bool fisheye) {
  const auto make = [](bool with_fisheye) {
    SyntheticSceneOptions options;
    options.trajectory = SceneTrajectory::kHover;
    options.times = with_fisheye ? 10 : 20;
    options.step = 0.03;
    options.fisheye = with_fisheye;
    Window made{make_synthetic_scene(options), {}};
    FillOptions noisy;
    noisy.rotation_noise = 0.005;
    noisy.translation_noise = 0.01;
    noisy.point_noise = 0.03;
    made.filled = fill_map(made.scene, noisy);
    return made;
  };
  static const Window kStereo = make(false);
  static const Window kMixed = make(true);
  return fisheye ? kMixed : kStereo;
}

ProblemConfig equal_work(const MapSnapshot& map) {
  ProblemConfig config;
  config.fixed_poses = {map.origin()};
  config.variable_poses = map.keyframe_ids();
  config.variable_poses.erase(config.variable_poses.begin());
  config.variable_landmarks = map.landmark_ids();
  config.options.rounds = {{kIterations, Loss::kNone, 0}};
  config.options.chi2_mono = config.options.chi2_stereo = 1e9;
  return config;
}

// The residual as a newcomer to Ceres writes it.
template <typename Model>
struct PlainResidual {
  std::array<double, Model::kParamCount> params;
  std::array<double, 3> measurement;
  double sigma;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, const T* point, T* residual) const {
    const Eigen::Matrix<T, 3, 1> in_cam = Eigen::Map<const Eigen::Quaternion<T>>(rotation) *
                                              Eigen::Map<const Eigen::Matrix<T, 3, 1>>(point) +
                                          Eigen::Map<const Eigen::Matrix<T, 3, 1>>(translation);
    std::array<T, Model::kParamCount> intrinsics;
    for (std::size_t i = 0; i < params.size(); ++i) intrinsics[i] = T(params[i]);
    T projected[Model::kMeasurementDim];
    if (!Model::project(intrinsics.data(), in_cam.data(), projected)) return false;
    for (std::size_t i = 0; i < Model::kMeasurementDim; ++i) {
      residual[i] = (projected[i] - measurement[i]) / sigma;
    }
    return true;
  }
};

template <typename Model, typename Params>
ceres::CostFunction* plain_cost(const Params& camera, const Keypoint& keypoint, float u_right) {
  std::array<double, Model::kParamCount> params;
  std::copy(camera.begin(), camera.begin() + Model::kParamCount, params.begin());
  return new ceres::AutoDiffCostFunction<PlainResidual<Model>, Model::kMeasurementDim, 4, 3, 3>(
      new PlainResidual<Model>{params, {keypoint.x, keypoint.y, u_right}, keypoint.sigma});
}

ceres::CostFunction* plain_cost(const Camera& camera, const Keypoint& keypoint, float u_right) {
  if (const auto* stereo = std::get_if<Calibrated<RectifiedStereo>>(&camera)) {
    if (std::isnan(u_right)) return plain_cost<Pinhole>(stereo->params, keypoint, 0);
    return plain_cost<RectifiedStereo>(stereo->params, keypoint, u_right);
  }
  return plain_cost<KannalaBrandt>(std::get<Calibrated<KannalaBrandt>>(camera).params, keypoint, 0);
}

double solve_plain(const MapSnapshot& map) {
  std::vector<Rigid3d> poses;
  for (const KeyframeId id : map.keyframe_ids()) poses.push_back(map.at(id).cam_from_world);
  std::vector<Eigen::Vector3d> points;
  for (const LandmarkId id : map.landmark_ids()) points.push_back(map.at(id).point_in_world);
  ceres::Problem problem;
  std::size_t point = 0;
  for (const LandmarkId id : map.landmark_ids()) {
    for (const Observation& observation : map.at(id).observations) {
      const Keyframe& keyframe = map.at(observation.keyframe);
      const FrameObservations& frame = *keyframe.observations;
      double* pose = poses[observation.keyframe.value].params.data();
      const float u_right =
          frame.u_right.empty() ? kNoRightMatch : frame.u_right[observation.keypoint];
      problem.AddResidualBlock(
          plain_cost(map.camera(keyframe), frame.features.keypoints[observation.keypoint], u_right),
          nullptr, pose, pose + 4, points[point].data());
    }
    ++point;
  }
  for (Rigid3d& pose : poses) {
    problem.SetManifold(pose.params.data(), new ceres::EigenQuaternionManifold);
  }
  problem.SetParameterBlockConstant(poses[0].params.data());
  problem.SetParameterBlockConstant(poses[0].params.data() + 4);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_SCHUR;
  options.max_num_iterations = kIterations;
  options.function_tolerance = 0;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary.final_cost;
}

void report(benchmark::State& state, double cost, int observations) {
  state.counters["final_cost"] = cost;
  state.counters["observations"] = observations;
}

void local_bundle_ours(benchmark::State& state) {
  const MapSnapshot& map = window(state.range(0) != 0).filled.map.view();
  const ProblemConfig config = equal_work(map);
  BundleResult result;
  for (auto _ : state) result = solve_bundle(map, config);
  report(state, result.summary.final_cost, result.summary.observations);
}

void local_bundle_plain_ceres(benchmark::State& state) {
  const MapSnapshot& map = window(state.range(0) != 0).filled.map.view();
  double cost = 0;
  for (auto _ : state) cost = solve_plain(map);
  report(state, cost, 0);
}

// The product's own two rounds, 5 robust and 10 plain, with the outlier test.
void local_bundle_two_rounds(benchmark::State& state) {
  const MapSnapshot& map = window(state.range(0) != 0).filled.map.view();
  ProblemConfig config = equal_work(map);
  config.options = ProblemOptions{};
  BundleResult result;
  for (auto _ : state) result = solve_bundle(map, config);
  report(state, result.summary.final_cost, result.summary.observations);
}

void add_keyframe(benchmark::State& state) {
  const Window& w = window(false);
  FilledMap filled = fill_map(w.scene, {});
  const Keyframe like = filled.map.view().at(filled.keyframes.back());
  for (auto _ : state) {
    const auto snapshot = filled.map.snapshot();
    const KeyframeId id = filled.map.add_keyframe(
        {like.observations, like.cam_from_world, like.landmarks, {}, like.id});
    state.PauseTiming();
    MapEdit undo;
    undo.erased_keyframes = {id};
    filled.map.apply(undo);
    state.ResumeTiming();
  }
  state.counters["observations"] = static_cast<double>(std::count_if(
      like.landmarks.begin(), like.landmarks.end(), [](auto l) { return l.valid(); }));
}

// Argument: 0 a stereo pair alone, 1 ten stereo and ten fisheye keyframes.
BENCHMARK(local_bundle_ours)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(local_bundle_plain_ceres)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(local_bundle_two_rounds)->Arg(0)->Arg(1)->Unit(benchmark::kMillisecond);
BENCHMARK(add_keyframe)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace hybrid_slam
