#include "frontend/pose/pnp_ransac.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <opengv/absolute_pose/CentralAbsoluteAdapter.hpp>
#include <opengv/absolute_pose/methods.hpp>

#include "cameras/geometry/se3.h"
#include "frontend/pose/normal_equations.h"
#include "frontend/pose/random_sampler.h"

namespace hybrid_slam {
namespace {

constexpr double kChi2 = 5.991;             // 95 %, 2 degrees of freedom
constexpr double kMinSine = 1e-6;           // of the angles in a sample's triangle
constexpr double kMinConditioning = 1e-12;  // smallest / largest eigenvalue of the scaled system
constexpr int kRefinements = 5;             // inliers are chosen anew before each
constexpr int kIterations = 10;
constexpr double kConvergedStep = 1e-10;  // [m, rad]

struct Correspondences {
  std::span<const Eigen::Vector3d> bearings;
  std::span<const Eigen::Vector3d> points;
  std::span<const double> sigma;
  int size() const { return static_cast<int>(bearings.size()); }
};

// Squared sine of the angle between bearing and point in units of its variance; infinite in the
// opposite half space.
double chi2(const Correspondences& data, std::size_t i, const Eigen::Matrix3d& rotation,
            const Eigen::Vector3d& translation) {
  const Eigen::Vector3d point = rotation * data.points[i] + translation;
  if (!(data.bearings[i].dot(point) > 0)) return std::numeric_limits<double>::infinity();
  const double squared_sine = data.bearings[i].cross(point).squaredNorm() / point.squaredNorm();
  return squared_sine / (data.sigma[i] * data.sigma[i]);
}

struct Consensus {
  Rigid3d cam_from_world;
  std::vector<char> inlier;
  int inliers = 0;
  double cost = std::numeric_limits<double>::infinity();  // sum of chi2, cut off at the threshold
};

Consensus evaluate(const Correspondences& data, const Rigid3d& cam_from_world) {
  Consensus result;
  result.cam_from_world = cam_from_world;
  result.inlier.assign(data.bearings.size(), 0);
  result.cost = 0;
  const Eigen::Matrix3d rotation = cam_from_world.rotation().toRotationMatrix();
  const Eigen::Vector3d translation = cam_from_world.translation();
  for (std::size_t i = 0; i < data.bearings.size(); ++i) {
    const double s = chi2(data, i, rotation, translation);
    const bool inlier = s <= kChi2;
    result.inlier[i] = inlier;
    result.inliers += inlier;
    result.cost += inlier ? s : kChi2;
  }
  return result;
}

// Points or bearings on one line (through the centre, for bearings) leave the pose open.
bool is_degenerate(const Correspondences& data, const std::array<int, 3>& sample) {
  const auto at = [&](const auto& values, int k) {
    return Eigen::Vector3d(values[static_cast<std::size_t>(sample[static_cast<std::size_t>(k)])]);
  };
  const Eigen::Vector3d ab = at(data.points, 1) - at(data.points, 0);
  const Eigen::Vector3d ac = at(data.points, 2) - at(data.points, 0);
  const bool on_line = !(ab.cross(ac).norm() > kMinSine * ab.norm() * ac.norm());
  const Eigen::Vector3d f0 = at(data.bearings, 0), f1 = at(data.bearings, 1),
                        f2 = at(data.bearings, 2);
  return on_line || !(f0.cross(f1).norm() > kMinSine) || !(f0.cross(f2).norm() > kMinSine) ||
         !(f1.cross(f2).norm() > kMinSine);
}

// OpenGV's containers live as long as its adapter.
class MinimalSolver {
 public:
  explicit MinimalSolver(const Correspondences& data)
      : bearings_(data.bearings.begin(), data.bearings.end()),
        points_(data.points.begin(), data.points.end()),
        adapter_(bearings_, points_) {}

  // At most four poses that are finite.
  std::vector<Rigid3d> solve(const std::array<int, 3>& sample) const {
    std::vector<Rigid3d> poses;
    for (const opengv::transformation_t& world_from_cam :
         opengv::absolute_pose::p3p_kneip(adapter_, {sample.begin(), sample.end()})) {
      if (!world_from_cam.allFinite()) continue;
      const Rigid3d pose(Eigen::Quaterniond(Eigen::Matrix3d(world_from_cam.leftCols<3>())),
                         world_from_cam.col(3));
      poses.push_back(inverse(pose));
    }
    return poses;
  }

 private:
  opengv::bearingVectors_t bearings_;
  opengv::points_t points_;
  opengv::absolute_pose::CentralAbsoluteAdapter adapter_;
};

// Iterations after which a sample of three inliers has been drawn with the wanted confidence.
int needed_iterations(double inlier_share, double confidence, int max_iterations) {
  const double good_sample = std::pow(inlier_share, 3);
  if (good_sample >= 1) return 1;
  const double needed = std::log(1 - confidence) / std::log1p(-good_sample);
  return needed < max_iterations ? static_cast<int>(std::ceil(needed)) : max_iterations;
}

std::optional<Consensus> search(const Correspondences& data, const PnpRansacOptions& options) {
  const MinimalSolver solver(data);
  RandomSampler sampler(options.seed);
  Consensus best;
  int iterations = options.max_iterations;
  for (int i = 0; i < iterations; ++i) {
    const std::array<int, 3> sample = sampler.three_of(data.size());
    if (is_degenerate(data, sample)) continue;
    for (const Rigid3d& pose : solver.solve(sample)) {
      Consensus candidate = evaluate(data, pose);
      if (candidate.cost >= best.cost) continue;
      best = std::move(candidate);
      iterations = needed_iterations(static_cast<double>(best.inliers) / data.size(),
                                     options.confidence, options.max_iterations);
    }
  }
  if (best.inliers < 3) return std::nullopt;
  return best;
}

// The residual of a bearing lies in the plane tangent to the sphere at the bearing that was
// measured: two coordinates [rad] along an orthonormal basis of that plane.
PoseNormalEquations linearize(const Correspondences& data, const Consensus& at) {
  PoseNormalEquations equations;
  const Eigen::Matrix3d rotation = at.cam_from_world.rotation().toRotationMatrix();
  for (std::size_t i = 0; i < data.bearings.size(); ++i) {
    if (!at.inlier[i]) continue;
    const Eigen::Vector3d point = rotation * data.points[i] + at.cam_from_world.translation();
    const double distance = point.norm();
    const Eigen::Vector3d direction = point / distance;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> basis;
    basis.row(0) = data.bearings[i].unitOrthogonal();
    basis.row(1) = data.bearings[i].cross(Eigen::Vector3d(basis.row(0)));
    const Eigen::Vector2d residual = basis * direction;
    const Eigen::Matrix<double, 2, 3, Eigen::RowMajor> d_point =
        (basis - residual * direction.transpose()) / distance;
    equations.add<2>(pose_jacobian<2>(d_point, point), residual,
                     1 / (data.sigma[i] * data.sigma[i]));
  }
  return equations;
}

// Whether the inliers determine all six unknowns, whatever the units of each.
bool is_determined(const Matrix6d& lower_information) {
  Matrix6d scaled = lower_information.selfadjointView<Eigen::Lower>();
  if (!(scaled.diagonal().minCoeff() > 0)) return false;
  const Vector6d scale = scaled.diagonal().cwiseSqrt().cwiseInverse();
  scaled = scale.asDiagonal() * scaled * scale.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(scaled, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues()[0] > kMinConditioning * eigen.eigenvalues()[5];
}

// Gauss-Newton on the inliers of `at`, which stay as they are.
std::optional<Rigid3d> minimize(const Correspondences& data, Consensus at) {
  for (int i = 0; i < kIterations; ++i) {
    const PoseNormalEquations equations = linearize(data, at);
    if (!is_determined(equations.information)) return std::nullopt;
    const std::optional<Vector6d> step = equations.solve(0);
    if (!step) return std::nullopt;
    at.cam_from_world = se3_exp(*step) * at.cam_from_world;
    if (step->norm() < kConvergedStep) break;
  }
  return at.cam_from_world;
}

// None if the inliers leave the pose open.
std::optional<Consensus> refine(const Correspondences& data, Consensus best) {
  for (int i = 0; i < kRefinements; ++i) {
    const std::optional<Rigid3d> pose = minimize(data, best);
    if (!pose) return std::nullopt;
    Consensus refined = evaluate(data, *pose);
    if (refined.cost > best.cost) break;
    const bool same = refined.inlier == best.inlier;
    best = std::move(refined);
    if (same) break;
  }
  return best;
}

void check(const Correspondences& data, const PnpRansacOptions& options) {
  if (data.points.size() != data.bearings.size() || data.sigma.size() != data.bearings.size()) {
    throw std::invalid_argument("solve_pnp_ransac: unequal numbers of bearings, points and sigmas");
  }
  if (!(options.confidence > 0 && options.confidence < 1) || options.max_iterations < 1) {
    throw std::invalid_argument("solve_pnp_ransac: confidence or max_iterations out of range");
  }
}

}  // namespace

std::optional<PnpResult> solve_pnp_ransac(std::span<const Eigen::Vector3d> bearings,
                                          std::span<const Eigen::Vector3d> points_in_world,
                                          std::span<const double> angular_sigma,
                                          const PnpRansacOptions& options) {
  const Correspondences data{bearings, points_in_world, angular_sigma};
  check(data, options);
  if (data.size() < std::max(3, options.min_inliers)) return std::nullopt;
  std::optional<Consensus> best = search(data, options);
  if (best) best = refine(data, std::move(*best));
  if (!best || best->inliers < options.min_inliers) return std::nullopt;
  return PnpResult{best->cam_from_world, std::move(best->inlier), best->inliers};
}

}  // namespace hybrid_slam
